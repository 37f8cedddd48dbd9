// The projection S onto the directions in which a node may move: w = 1 along the plane with normal
// xyz, w = 2 along the line xyz, 0 free.

fn projection(freedom: vec4<f32>) -> mat3x3<f32> {
    let n = freedom.xyz;
    let outer = mat3x3<f32>(n.x * n, n.y * n, n.z * n);
    let identity = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    if (freedom.w == 2.0) {
        return outer;
    }
    return identity - freedom.w * outer;
}

fn projected(freedom: vec4<f32>, x: vec3<f32>) -> vec3<f32> {
    let along = dot(freedom.xyz, x) * freedom.xyz;
    return select(x - freedom.w * along, along, freedom.w == 2.0);
}
