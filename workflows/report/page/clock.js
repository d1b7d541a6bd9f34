// The play head: one time [s] that the 3-D view and all plots over time follow.

const LOOP = 14; // s that the whole record takes at speed 1
const SLOW = 45; // ms of a frame

/** A clock over a duration [s]; speed 1 shows it in LOOP seconds. */
export function clockOf(duration) {
  const listeners = [];
  const clock = { time: 0, duration, speed: 1, playing: false, frames: 0 };
  let last = 0;
  let spent = [];
  let slow = () => {};

  clock.onTime = (listener) => listeners.push(listener);

  clock.seek = (time) => {
    clock.time = Math.min(Math.max(time, 0), duration);
    for (const listener of listeners) listener(clock.time);
  };

  clock.play = (on) => {
    clock.playing = on;
    last = 0;
    if (on) requestAnimationFrame(step);
    for (const listener of listeners) listener(clock.time);
  };

  /** How many times slower than in truth the record is shown. */
  clock.slowness = () => LOOP / clock.speed / duration;

  /** Call back once for every run of frames that take longer than SLOW on the mean. */
  clock.onSlow = (listener) => (slow = listener);

  function step(now) {
    if (!clock.playing) return;
    if (last) spent.push(now - last);
    if (spent.length === 12) {
      if (spent.reduce((sum, ms) => sum + ms) > 12 * SLOW) slow();
      spent = [];
    }
    const passed = last ? ((now - last) / 1000 / LOOP) * clock.speed * duration : 0;
    last = now;
    clock.frames += 1;
    clock.seek(clock.time + passed >= duration ? 0 : clock.time + passed);
    requestAnimationFrame(step);
  }

  return clock;
}
