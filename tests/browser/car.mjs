// A passenger car's drive as a text file, with its column map and its vehicle.

import { writeFileSync } from "node:fs";
import { join } from "node:path";

const RATE_HZ = 100;
const MAP = ["[time]", 'column = "t"',
  ...[["vx", "speed.forward", "km/h"], ["steer", "steer", "deg"], ["yaw", "rate.z", "deg/s"], ["ay", "acceleration.y", "m/s^2"]]
    .flatMap(([name, quantity, unit]) => [`[column.${name}]`, `quantity = "${quantity}"`, `unit = "${unit}"`]), ""];
const CAR = ['name = "car"', "[body]", "mass_kg = 1450.0", "front_axle_to_cg_m = 1.15", "cg_to_rear_axle_m = 1.45",
  "[steering]", "ratio = 15.0", ""];

// A single-track car with a sinusoidal steering wheel at constant speed.
export function car(directory, name, seconds) {
  const speed = 20;
  const rows = ["t,vx,steer,yaw,ay"];
  for (let n = 0; n < seconds * RATE_HZ; n++) {
    const t = n / RATE_HZ;
    const steer = 30 * Math.sin(0.5 * t);
    const road = steer / 15 * Math.PI / 180;
    const yaw = speed / (2.6 + 0.0028 * speed ** 2) * road;
    rows.push([t, speed * 3.6, steer, yaw * 180 / Math.PI, yaw * speed].map((v) => v.toFixed(4)).join(","));
  }
  writeFileSync(join(directory, `${name}.csv`), `${rows.join("\n")}\n`);
  writeFileSync(join(directory, "map.toml"), MAP.join("\n"));
  writeFileSync(join(directory, "car.toml"), CAR.join("\n"));
}
