// The assembly in motion: X + s sum_k q_k(t) phi_k(X) at its outer nodes.

import { between, columns } from "./arrays.js";

/** Displacements of an assembly by time or by mode, all in metres. */
export function motionOf(assembly) {
  const shapes = columns(assembly.shapes);
  const q = assembly.q ? columns(assembly.q) : [];
  const nodes = assembly.points.shape[0];

  function add(u, shape, amount) {
    for (let i = 0; i < u.length; i++) u[i] += amount * shape[i];
  }

  /** Coordinates of the wall's modes at a time [s]. */
  function coordinates(t) {
    return q.map((_, k) => between(q, t / assembly.dt, k));
  }

  /** u_w = sum phi_k q_k: the displacement that the chain feels, from rest. */
  function atContact(t) {
    return coordinates(t).reduce((sum, value, k) => sum + value * assembly.phi[k], 0);
  }

  /** Displacements (3 per node) at a time, into u. */
  function atTime(t, u) {
    u.fill(0);
    coordinates(t).forEach((value, k) => {
      if (assembly.of_wall[k] >= 0) add(u, shapes[assembly.of_wall[k]], value);
    });
    return u;
  }

  /** Displacements of a mode shape, largest 1, times an amplitude, into u. */
  function inMode(column, amplitude, u) {
    u.fill(0);
    add(u, shapes[column], amplitude / (largestNode(shapes[column]) || 1));
    return u;
  }

  /** The largest displacement of any node at some instants over a duration. */
  function peak(duration, instants = 150) {
    const u = new Float32Array(3 * nodes);
    let most = 0;
    for (let i = 0; i <= instants; i++) {
      most = Math.max(most, largestNode(atTime((duration * i) / instants, u)));
    }
    return most;
  }

  return { nodes, atContact, atTime, inMode, peak };
}

/** The largest displacement of a node. */
export function largestNode(u) {
  let most = 0;
  for (let i = 0; i < u.length; i += 3) {
    most = Math.max(most, u[i] * u[i] + u[i + 1] * u[i + 1] + u[i + 2] * u[i + 2]);
  }
  return Math.sqrt(most);
}
