// Parents of a node under linear embedding: per axis one with weight 1 for an even index, two with
// ½ each for an odd one, so that all parents of a node weigh the same.
//
// uses implicit/linear/level

struct Parent {
    exists: bool,
    id: vec4<i32>,
    // Where the child is as seen from it: offsets −1..1 from fine node 2j, x slowest.
    child: u32,
}

// Candidate k < 8 of the parents of a node.
fn parent(coarse: Level, id: vec4<i32>, k: u32) -> Parent {
    let bit = vec3<i32>(vec3<u32>(k >> 2u, k >> 1u, k) & vec3<u32>(1u));
    let halved = coarse.factor == vec3<i32>(2);
    let odd = select(vec3<i32>(0), id.xyz & vec3<i32>(1), halved);
    let offset = vec3<u32>(odd - 2 * bit + 1);
    let at = wrapped(coarse, select(id.xyz, (id.xyz >> vec3<u32>(1u)) + bit, halved));
    return Parent(all(bit <= odd), vec4<i32>(at, id.w), (offset.x * 3u + offset.y) * 3u + offset.z);
}
