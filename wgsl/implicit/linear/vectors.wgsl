// Fields are channel-major: component a of row i is at a * stride + i.
//
// uses implicit/linear/level

fn inverse_times(row: u32, x: vec3<f32>) -> vec3<f32> {
    let n = level.stride;
    let xx = inverse[row];
    let xy = inverse[n + row];
    let xz = inverse[2u * n + row];
    let yy = inverse[3u * n + row];
    let yz = inverse[4u * n + row];
    let zz = inverse[5u * n + row];
    return vec3<f32>(xx * x.x + xy * x.y + xz * x.z, xy * x.x + yy * x.y + yz * x.z, xz * x.x + yz * x.y + zz * x.z);
}
