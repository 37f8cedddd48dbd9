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
