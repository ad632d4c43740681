// How real karts are: read here and not with the other messages, since only the steward's view asks.

import type { ByteBuffer } from 'flatbuffers';
import { SensorState } from '../wire/generated/codes.js';
import type { KartTelemetry as KartTelemetryStruct } from '../wire/generated/spectate/kart-telemetry.js';
import { Telemetries } from '../wire/generated/spectate/telemetries.js';
import { rowsOf } from '../wire/rows';

export interface KartTelemetry {
  seat: number;
  speed: number; // [m/s]
  deviation: number; // [m] of the place, 0 where it is not known
  headingDeviation: number; // [rad]
  link: number; // [s] since the newest word of the server, negative before the first
  battery: number; // [0, 1], negative where it is not known
  sensors: SensorState[]; // by Sensor
  stage: number;
  cause: number;
}

const SENSORS = 8;

/** Returns how each kart of a message is; none if it is damaged. */
export function readTelemetry(buffer: ByteBuffer): KartTelemetry[] {
  try {
    const table = Telemetries.getRootAsTelemetries(buffer);
    return rowsOf(table.kartsLength(), (row) => readKart(table.karts(row)!));
  } catch {
    return []; // only a damaged message raises an error
  }
}

function readKart(kart: KartTelemetryStruct): KartTelemetry {
  const bits = kart.sensors();
  return {
    seat: kart.seat(),
    speed: kart.speed(),
    deviation: kart.deviation(),
    headingDeviation: kart.headingDeviation(),
    link: kart.link(),
    battery: kart.battery(),
    sensors: Array.from({ length: SENSORS }, (_, sensor) => (bits >>> (4 * sensor)) & 15),
    stage: kart.stage(),
    cause: kart.cause(),
  };
}
