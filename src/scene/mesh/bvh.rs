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

/// A triangle's corners, and its number in the mesh.
struct Face {
    corners: [[f64; 3]; 3],
    number: u32,
}

/// The triangles of a mesh in a tree.
pub struct Bvh {
    nodes: Vec<Node>,
    faces: Vec<Face>,
}

impl Bvh {
    pub fn new(mesh: &TriangleMesh) -> Self {
        let face = |number: usize| Face { corners: mesh.corners(number), number: number as u32 };
        let mut faces: Vec<Face> = (0..mesh.triangles.len()).map(face).collect();
        let mut nodes = Vec::with_capacity(2 * faces.len() / LEAF + 1);
        let all = faces.len();
        if all > 0 {
            build(&mut nodes, &mut faces, 0, all);
        }
        Self { nodes, faces }
    }

    /// Distance to the nearest triangle (m) and its place in the tree. `guess`, a place that is
    /// probably near, saves most of the search. Adds the nodes that were looked at to `visited`.
    pub fn nearest(&self, x: [f64; 3], guess: usize, visited: &mut u64) -> (f64, usize) {
        let mut best =
            self.faces.get(guess).map_or((f64::INFINITY, guess), |face| (distance2(x, &face.corners), guess));
        let mut open = Vec::with_capacity(64);
        open.push((0usize, 0.0));
        while let Some((n, least)) = open.pop() {
            let Some(node) = self.nodes.get(n).filter(|_| least < best.0) else { continue };
            *visited += 1;
            if node.count > 0 {
                for n in node.start as usize..(node.start + node.count) as usize {
                    let d2 = distance2(x, &self.faces[n].corners);
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

    /// Triangles whose boxes meet the box from `lower` to `upper`: their corners and numbers in the mesh.
    pub fn around(&self, lower: [f64; 3], upper: [f64; 3], mut met: impl FnMut(&[[f64; 3]; 3], u32)) {
        let mut open = Vec::with_capacity(64);
        open.push(0usize);
        while let Some(n) = open.pop() {
            let apart = |node: &&Node| (0..3).any(|a| node.lower[a] > upper[a] || node.upper[a] < lower[a]);
            let Some(node) = self.nodes.get(n).filter(|node| !apart(node)) else { continue };
            if node.count > 0 {
                let (start, end) = (node.start as usize, (node.start + node.count) as usize);
                self.faces[start..end].iter().for_each(|face| met(&face.corners, face.number));
            } else {
                open.extend([node.start as usize, n + 1]);
            }
        }
    }

    /// Distance to the triangle at a place in the tree (m).
    pub fn distance_to(&self, place: usize, x: [f64; 3]) -> f64 {
        distance2(x, &self.faces[place].corners).sqrt()
    }

    /// The corners of the triangle at a place in the tree.
    pub fn corners(&self, place: usize) -> &[[f64; 3]; 3] {
        &self.faces[place].corners
    }

    /// The generalized winding number (Jacobson et al. 2013): 1 inside a closed mesh, 0 outside,
    /// and between the two near holes. Adds the nodes that were looked at to `visited`.
    pub fn winding(&self, x: [f64; 3], visited: &mut u64) -> f64 {
        let mut sum = 0.0;
        let mut open = Vec::with_capacity(64);
        open.push(0usize);
        while let Some(n) = open.pop() {
            let Some(node) = self.nodes.get(n) else { continue };
            *visited += 1;
            let r = sub(node.center, x);
            let d2 = dot(r, r);
            if d2 > (FAR * node.radius).powi(2) {
                sum += dot(node.dipole, r) / (d2 * d2.sqrt());
            } else if node.count > 0 {
                let (start, end) = (node.start as usize, (node.start + node.count) as usize);
                sum += self.faces[start..end].iter().map(|face| solid_angle(x, &face.corners)).sum::<f64>();
            } else {
                open.extend([node.start as usize, n + 1]);
            }
        }
        sum / (4.0 * PI)
    }

    /// Calls `met` for each triangle that the ray from `x` along `way` goes through: its number, and
    /// whether the ray leaves through its outward side.
    pub fn crossings(&self, x: [f64; 3], way: [f64; 3], mut met: impl FnMut(u32, bool)) {
        let mut open = Vec::with_capacity(64);
        open.push(0usize);
        while let Some(n) = open.pop() {
            let Some(node) = self.nodes.get(n).filter(|node| node.is_crossed(x, way)) else { continue };
            if node.count > 0 {
                let (start, end) = (node.start as usize, (node.start + node.count) as usize);
                for face in &self.faces[start..end] {
                    if let Some(outwards) = crossing(x, way, &face.corners) {
                        met(face.number, outwards);
                    }
                }
            } else {
                open.extend([node.start as usize, n + 1]);
            }
        }
    }
}

impl Node {
    /// Squared distance to the box.
    fn distance2(&self, x: [f64; 3]) -> f64 {
        (0..3).map(|a| (self.lower[a] - x[a]).max(x[a] - self.upper[a]).max(0.0).powi(2)).sum()
    }

    /// Whether the ray from `x` along `way`, whose components are all above 0, meets the box.
    fn is_crossed(&self, x: [f64; 3], way: [f64; 3]) -> bool {
        let enter = (0..3).map(|a| (self.lower[a] - x[a]) / way[a]).fold(0.0, f64::max);
        let leave = (0..3).map(|a| (self.upper[a] - x[a]) / way[a]).fold(f64::INFINITY, f64::min);
        enter <= leave
    }
}

/// Builds the tree over `triangles[start..end]`, with nodes in depth-first order.
fn build(nodes: &mut Vec<Node>, faces: &mut [Face], start: usize, end: usize) {
    let own = &mut faces[start..end];
    let (mut lower, mut upper) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let (mut dipole, mut center, mut area) = ([0.0; 3], [0.0; 3], 0.0);
    for face in own.iter() {
        let t = &face.corners;
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
    // Where middles are spread most: boxes of long triangles overlap along their length.
    let key = |face: &Face, axis: usize| face.corners.iter().map(|v| v[axis]).sum::<f64>();
    let spread = |axis: usize| {
        let ends = own
            .iter()
            .map(|face| key(face, axis))
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
        ends[1] - ends[0]
    };
    let spreads = [0, 1, 2].map(spread);
    let axis = (0..3).max_by(|&a, &b| spreads[a].total_cmp(&spreads[b])).unwrap_or(0);
    let middle = (end - start) / 2;
    own.select_nth_unstable_by(middle, |a, b| key(a, axis).total_cmp(&key(b, axis)));
    build(nodes, faces, start, start + middle);
    nodes[n].start = nodes.len() as u32;
    build(nodes, faces, start + middle, end);
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

/// Whether the ray from `x` along `way` goes through a triangle (Möller & Trumbore 1997), and if so
/// whether through its outward side.
fn crossing(x: [f64; 3], way: [f64; 3], [a, b, c]: &[[f64; 3]; 3]) -> Option<bool> {
    let (ab, ac, ax) = (sub(*b, *a), sub(*c, *a), sub(x, *a));
    let p = cross(way, ac);
    let det = dot(ab, p);
    let q = cross(ax, ab);
    let (u, v, t) = (dot(ax, p) / det, dot(way, q) / det, dot(ac, q) / det);
    // A ray along the triangle's plane gives no numbers, and does not go through.
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(det < 0.0)
}
