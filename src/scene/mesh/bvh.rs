//! A tree of boxes over triangles: the distance to the nearest triangle, and how often the surface
//! winds around a point.

use std::f64::consts::PI;

use super::triangles::{TriangleMesh, cross, dot, sub};

/// Most triangles of a leaf.
const LEAF: usize = 6;

/// A node this many radii away counts as one dipole (Barill et al. 2018, Fast winding numbers for
/// soups and clouds, §3).
const FAR: f64 = 3.0;

struct Node {
    lower: [f64; 3],
    upper: [f64; 3],
    /// The first triangle of a leaf, or the second child of an inner node; the first child follows
    /// its parent.
    start: u32,
    /// Number of triangles of a leaf; 0 for an inner node.
    count: u32,
    /// The sum of area vectors (m²), their centre, and the distance from there to the farthest
    /// corner of the box.
    dipole: [f64; 3],
    center: [f64; 3],
    radius: f64,
}

/// The triangles of a mesh in a tree.
pub struct Bvh {
    nodes: Vec<Node>,
    triangles: Vec<[[f64; 3]; 3]>,
}

impl Bvh {
    pub fn new(mesh: &TriangleMesh) -> Self {
        let mut triangles: Vec<[[f64; 3]; 3]> =
            mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize])).collect();
        let mut nodes = Vec::with_capacity(2 * triangles.len() / LEAF + 1);
        let all = triangles.len();
        if all > 0 {
            build(&mut nodes, &mut triangles, 0, all);
        }
        Self { nodes, triangles }
    }

    /// Distance to the nearest triangle (m) and its number. `guess`, a triangle that is probably
    /// near, saves most of the search.
    pub fn nearest(&self, x: [f64; 3], guess: usize) -> (f64, usize) {
        let mut best = self.triangles.get(guess).map_or((f64::INFINITY, guess), |t| (distance2(x, t), guess));
        let mut open = Vec::with_capacity(64);
        open.push((0usize, 0.0));
        while let Some((n, least)) = open.pop() {
            let Some(node) = self.nodes.get(n).filter(|_| least < best.0) else { continue };
            if node.count > 0 {
                for n in node.start as usize..(node.start + node.count) as usize {
                    let d2 = distance2(x, &self.triangles[n]);
                    best = if d2 < best.0 { (d2, n) } else { best };
                }
                continue;
            }
            let children = [n + 1, node.start as usize].map(|c| (c, self.nodes[c].distance2(x)));
            let nearer = usize::from(children[1].1 < children[0].1);
            open.extend([children[1 - nearer], children[nearer]]);
        }
        (best.0.sqrt(), best.1)
    }

    /// The generalized winding number (Jacobson et al. 2013): 1 inside a closed mesh, 0 outside,
    /// and between the two near holes.
    pub fn winding(&self, x: [f64; 3]) -> f64 {
        let mut sum = 0.0;
        let mut open = Vec::with_capacity(64);
        open.push(0usize);
        while let Some(n) = open.pop() {
            let Some(node) = self.nodes.get(n) else { continue };
            let r = sub(node.center, x);
            let d2 = dot(r, r);
            if d2 > (FAR * node.radius).powi(2) {
                sum += dot(node.dipole, r) / (d2 * d2.sqrt());
            } else if node.count > 0 {
                let (start, end) = (node.start as usize, (node.start + node.count) as usize);
                sum += self.triangles[start..end].iter().map(|t| solid_angle(x, t)).sum::<f64>();
            } else {
                open.extend([node.start as usize, n + 1]);
            }
        }
        sum / (4.0 * PI)
    }
}

impl Node {
    /// Squared distance to the box.
    fn distance2(&self, x: [f64; 3]) -> f64 {
        (0..3).map(|a| (self.lower[a] - x[a]).max(x[a] - self.upper[a]).max(0.0).powi(2)).sum()
    }
}

/// Builds the tree over `triangles[start..end]`, with nodes in depth-first order.
fn build(nodes: &mut Vec<Node>, triangles: &mut [[[f64; 3]; 3]], start: usize, end: usize) {
    let own = &mut triangles[start..end];
    let (mut lower, mut upper) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let (mut dipole, mut center, mut area) = ([0.0; 3], [0.0; 3], 0.0);
    for t in own.iter() {
        let vector = cross(sub(t[1], t[0]), sub(t[2], t[0])).map(|n| 0.5 * n);
        let size = dot(vector, vector).sqrt();
        for a in 0..3 {
            for v in t {
                lower[a] = lower[a].min(v[a]);
                upper[a] = upper[a].max(v[a]);
            }
            dipole[a] += vector[a];
            center[a] += size * (t[0][a] + t[1][a] + t[2][a]) / 3.0;
        }
        area += size;
    }
    let center = std::array::from_fn(|a| if area > 0.0 { center[a] / area } else { 0.5 * (lower[a] + upper[a]) });
    let reach: [f64; 3] = std::array::from_fn(|a| (center[a] - lower[a]).max(upper[a] - center[a]));
    let n = nodes.len();
    let leaf = end - start <= LEAF;
    let (first, count) = if leaf { (start as u32, (end - start) as u32) } else { (0, 0) };
    nodes.push(Node { lower, upper, start: first, count, dipole, center, radius: dot(reach, reach).sqrt() });
    if leaf {
        return;
    }
    let axis = (0..3).max_by(|&a, &b| (upper[a] - lower[a]).total_cmp(&(upper[b] - lower[b]))).unwrap_or(0);
    let middle = (end - start) / 2;
    let key = |t: &[[f64; 3]; 3]| t[0][axis] + t[1][axis] + t[2][axis];
    own.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
    build(nodes, triangles, start, start + middle);
    nodes[n].start = nodes.len() as u32;
    build(nodes, triangles, start + middle, end);
}

/// Squared distance from a point to a triangle (Ericson 2005, Real-time collision detection,
/// §5.1.5).
fn distance2(x: [f64; 3], [a, b, c]: &[[f64; 3]; 3]) -> f64 {
    let (ab, ac, ax) = (sub(*b, *a), sub(*c, *a), sub(x, *a));
    let to = |u: f64, v: f64| {
        let r: [f64; 3] = std::array::from_fn(|k| ax[k] - u * ab[k] - v * ac[k]);
        dot(r, r)
    };
    let (d1, d2) = (dot(ab, ax), dot(ac, ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return to(0.0, 0.0);
    }
    let bx = sub(x, *b);
    let (d3, d4) = (dot(ab, bx), dot(ac, bx));
    if d3 >= 0.0 && d4 <= d3 {
        return to(1.0, 0.0);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return to(d1 / (d1 - d3), 0.0);
    }
    let cx = sub(x, *c);
    let (d5, d6) = (dot(ab, cx), dot(ac, cx));
    if d6 >= 0.0 && d5 <= d6 {
        return to(0.0, 1.0);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return to(0.0, d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return to(1.0 - w, w);
    }
    let sum = va + vb + vc;
    if sum > 0.0 { to(vb / sum, vc / sum) } else { to(0.0, 0.0).min(to(1.0, 0.0)).min(to(0.0, 1.0)) }
}

/// Solid angle of a triangle seen from a point (van Oosterom & Strackee 1983), positive from behind
/// its outward side.
fn solid_angle(x: [f64; 3], t: &[[f64; 3]; 3]) -> f64 {
    let [a, b, c] = t.map(|v| sub(v, x));
    let [la, lb, lc] = [a, b, c].map(|v| dot(v, v).sqrt());
    let volume = dot(a, cross(b, c));
    let product = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    2.0 * volume.atan2(product)
}
