// The plots of a job: what its diagnostics say of energies, momenta, steps and iterations.

import { plot } from "./plot.js";

const TIME = { key: "time_s", name: "at", unit: "s", label: "time (s)" };

const FRAMES = [
  {
    title: "Energy",
    unit: "J",
    scaled: true,
    series: [
      { name: "kinetic", key: "kinetic" },
      { name: "strain", key: "strain_j" },
      { name: "gravity", key: "gravity_j" },
      { name: "total", key: "total" },
    ],
  },
  {
    title: "Momentum",
    unit: "kg m/s",
    series: ["x", "y", "z"].map((axis) => ({ name: axis, key: `momentum_${axis}` })),
  },
  { title: "Largest speed", unit: "m/s", series: [{ name: "speed", key: "max_speed" }] },
  { title: "Mean step of a frame", unit: "s", scaled: true, series: [{ name: "dt", key: "dt_s" }] },
  { title: "Steps of a frame", unit: "", series: [{ name: "steps", key: "steps" }] },
];

const STEPS = [
  {
    title: "Iterations of an implicit step",
    unit: "",
    series: [
      { name: "outer", key: "iterations" },
      { name: "inner", key: "inner_iterations" },
    ],
  },
];

/** A row of diagnostics, with the sums that are plotted. The affine part belongs to the motion. */
function summed(row) {
  const kinetic = row.kinetic_j + row.affine_j;
  return { ...row, kinetic, total: kinetic + row.strain_j + row.gravity_j };
}

/** The plots, to be put into a place; `update` takes the rows of frames and of implicit steps. */
export function plots(place) {
  let [frames, steps] = [null, null];
  const add = (list) => {
    const made = list.map((what) => plot({ ...what, x: TIME }));
    place.append(...made.map(({ element }) => element));
    return made;
  };
  const update = (rows, solver) => {
    if (rows.length) frames ??= add(FRAMES);
    if (solver.length) steps ??= add(STEPS);
    // The first frame has no steps before it.
    const stepped = rows.map((row, n) => (n ? summed(row) : { ...summed(row), dt_s: NaN, steps: NaN }));
    frames?.forEach(({ update: draw }) => draw(stepped));
    steps?.forEach(({ update: draw }) => draw(solver));
  };
  return { update };
}
