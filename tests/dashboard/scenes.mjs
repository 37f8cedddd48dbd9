// Scenes that run in moments, or without end.

/** A block of jelly that falls onto the floor: about 500 particles. */
export const block = (end, name = "block") => ({
  gridfall: 1,
  name,
  domain: { min: [0, 0, 0], max: [1, 1, 1], dx: 0.0625, boundary: { "z-": { contact: "separate", friction: 0.3 } } },
  gravity: [0, 0, -9.81],
  materials: { jelly: { model: "fixed-corotated", density: 1000, youngs_modulus: 1e5, poissons_ratio: 0.3 } },
  bodies: [
    {
      name: "block",
      material: "jelly",
      angular_velocity: [3, 0, 0],
      shape: { box: { min: [0.375, 0.375, 0.5], max: [0.625, 0.625, 0.75] } },
    },
  ],
  time: { end, frame_rate: 20 },
});

/** What is wrong: an unknown material, a negative density, a misspelt field. */
export const faulty = {
  ...block(1),
  materials: { jelly: { ...block(1).materials.jelly, density: -1 } },
  bodies: [{ ...block(1).bodies[0], material: "jely" }],
};

/** A block that falls between a post, a plate that rises, and a tube that is there from 0.2 s on. */
export const obstacles = (end = 0.5) => ({
  ...block(end, "obstacles"),
  colliders: [
    { name: "post", shape: { sphere: { center: [0.25, 0.25, 0.2], radius: 0.15 } }, contact: "slip" },
    {
      name: "plate",
      shape: { box: { min: [0.6, 0.1, 0.05], max: [0.9, 0.4, 0.12] } },
      contact: "slip",
      motion: { linear_velocity: [0, 0, 0.5] },
    },
    {
      name: "tube",
      shape: {
        difference: [
          { cylinder: { center: [0.75, 0.75, 0.3], axis: [0, 0, 1], radius: 0.2, height: 0.5 } },
          { cylinder: { center: [0.75, 0.75, 0.3], axis: [0, 0, 1], radius: 0.15, height: 0.6 } },
        ],
      },
      contact: "slip",
      from: 0.2,
    },
  ],
  output: { fields: ["velocity", "body"] },
});

/** A square beside a disc, in a plane. */
export const plane = (end = 0.2) => ({
  ...block(end, "plane"),
  dimension: 2,
  domain: { min: [0, 0], max: [1, 1], dx: 0.0625 },
  gravity: [0, -9.81],
  bodies: [{ name: "square", material: "jelly", shape: { box: { min: [0.25, 0.5], max: [0.5, 0.75] } } }],
  colliders: [{ name: "disc", shape: { sphere: { center: [0.7, 0.3], radius: 0.15 } }, contact: "slip" }],
});

/** A tetrahedron (OBJ), as a file of a user. */
export const tetrahedron = `v 0.3 0.3 0.4
v 0.7 0.3 0.4
v 0.5 0.7 0.4
v 0.5 0.45 0.8
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
`;
