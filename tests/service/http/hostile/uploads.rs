//! Uploads that are no assets.

/// Files that are no meshes and no particles.
pub fn uploads() -> Vec<Vec<u8>> {
    let mut files: Vec<Vec<u8>> = [
        "",
        " ",
        "\0",
        "solid",
        "solid x\nfacet normal nan nan nan\nouter loop\nvertex 0 0\nendloop",
        "v 0 0 0\n",
        "v 0 0 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 999999999\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 0 0\n",
        "v nan inf 1e999\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -5 -6\n",
        "v 1\nf 1\n",
        "ply\n",
        "ply\nformat ascii 1.0\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 4294967295\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex -1\nproperty float x\nend_header\n",
        "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\nproperty double x\nend_header\n\0\0",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\nend_header\n255 1\n",
        "ply\nformat ascii 9.9\nelement vertex 1\nproperty float x\nend_header\nnan\n",
        "glTF",
        "{\"asset\":{\"version\":\"2.0\"}}",
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":99,\"uri\":\"http://localhost/x\"}]}",
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":99,\"uri\":\"file:///etc/passwd\"}]}",
        "<svg/>",
        "%PDF-1.7",
        "PK\u{3}\u{4}",
        "{}",
        "[]",
    ]
    .iter()
    .map(|text| text.as_bytes().to_vec())
    .collect();
    // A binary STL that promises four thousand million triangles.
    files.push([vec![0; 80], vec![0xff; 4], vec![0; 50]].concat());
    // A GLB that is longer than itself, and one whose first chunk is.
    files.push([b"glTF".as_slice(), &[2, 0, 0, 0], &[0xff; 4]].concat());
    files.push([b"glTF".as_slice(), &[2, 0, 0, 0, 20, 0, 0, 0], &[0xff; 4], b"JSON"].concat());
    // An archive with an end and no beginning.
    files.push([b"PK\x05\x06".as_slice(), &[0xff; 18]].concat());
    files.push(vec![0xff; 1000]);
    files
}
