// Messages of the race, from bytes to plain data. The identifier in bytes 4..8 says which it is.

import { ByteBuffer } from 'flatbuffers';

import type {
  Disc,
  EffectFrame,
  EventFrame,
  Frame,
  HazardFrame,
  KartAlert,
  KartFrame,
  StandingFrame,
  TrailerFrame,
} from './frames';
import {
  AlertMessage,
  Alerts,
  Briefing,
  Events,
  Hud,
  Links,
  PoseMessage,
  Rays,
  Snapshot,
  Standings,
} from './tables';
import { readCourse, readLine, readLot, readRules } from './decodeCourse';
import { readGhosts, readProgramme } from './decodeEvent';
import { readHint } from './decodeHint';
import { NOTHING, rowsOf } from './rows';

/** Returns the message in some bytes, null if they are damaged or unknown. */
export function decode(data: ArrayBuffer): Frame | null {
  if (data.byteLength < 8) return null;
  const bytes = new Uint8Array(data);
  const identifier = String.fromCharCode(...bytes.subarray(4, 8));
  const read = READERS[identifier];
  if (!read) return null;
  try {
    return read(new ByteBuffer(bytes));
  } catch {
    return null; // only a damaged message raises an error
  }
}

const READERS: Record<string, (buffer: ByteBuffer) => Frame> = {
  RSNP: readSnapshot,
  RSTD: readStandings,
  REVT: readEvents,
  RCRS: readCourse,
  RRUL: readRules,
  RLIN: readLine,
  RRAY: readRays,
  RLNK: readLinks,
  RALS: readAlerts,
  RTLS: (buffer) => ({ kind: 'telemetry', buffer }),
  RHNT: readHint,
  RLOT: readLot,
  RHUD: readHud,
  RALR: readOwnAlert,
  RPOS: readOwnPose,
  RBRF: readBriefing,
  RPRG: readProgramme,
  RGHO: readGhosts,
};

function readSnapshot(buffer: ByteBuffer): Frame {
  const table = Snapshot.getRootAsSnapshot(buffer);
  return {
    kind: 'snapshot',
    serverMs: Number(table.monotonicUs()) / 1000,
    epoch: table.epoch(),
    tick: table.tick(),
    lights: table.lights(),
    phase: table.phase(),
    flag: table.flag(),
    karts: rowsOf(table.kartsLength(), (row) => readKart(table, row)),
    boxes: table.boxesArray() ?? new Uint8Array(),
    hazards: rowsOf(table.hazardsLength(), (row) => readHazard(table, row)),
    walkers: rowsOf(table.walkersLength(), (row) => readWalker(table, row)),
    trailers: rowsOf(table.trailersLength(), (row) => readTrailer(table, row)),
  };
}

function readKart(table: Snapshot, row: number): KartFrame {
  const kart = table.karts(row)!;
  return {
    seat: kart.seat(),
    x: kart.x(),
    y: kart.y(),
    heading: kart.heading(),
    speed: kart.speed(),
    lateralSpeed: kart.lateralSpeed(),
    yawRate: kart.yawRate(),
    steering: kart.steering(),
    progress: kart.progress(),
    speedCap: kart.speedCap(),
    acknowledged: kart.acknowledged(),
    laps: kart.laps(),
    rank: kart.rank(),
    status: kart.status(),
    item: kart.item(),
    effects: kart.effects(),
    flags: kart.flags(),
  };
}

function readHazard(table: Snapshot, row: number): HazardFrame {
  const hazard = table.hazards(row)!;
  return {
    x: hazard.x(),
    y: hazard.y(),
    radius: hazard.radius(),
    item: hazard.item(),
  };
}

function readWalker(table: Snapshot, row: number): Disc {
  const walker = table.walkers(row)!;
  return { x: walker.x(), y: walker.y(), radius: walker.radius() };
}

function readTrailer(table: Snapshot, row: number): TrailerFrame {
  const trailer = table.trailers(row)!;
  return {
    x: trailer.x(),
    y: trailer.y(),
    heading: trailer.heading(),
    length: trailer.length(),
    width: trailer.width(),
    limit: trailer.limit(),
    seat: trailer.seat(),
  };
}

function readStandings(buffer: ByteBuffer): Frame {
  const table = Standings.getRootAsStandings(buffer);
  return {
    kind: 'standings',
    epoch: table.epoch(),
    tick: table.tick(),
    startTick: table.startTick(),
    phase: table.phase(),
    flag: table.flag(),
    laps: table.laps(),
    course: table.course() ?? '',
    rows: rowsOf(table.rowsLength(), (row) => readStanding(table, row)),
  };
}

function readStanding(table: Standings, index: number): StandingFrame {
  const row = table.rows(index)!;
  const parking = row.parking();
  const planned = row.planned();
  const timing = row.timing();
  return {
    driver: row.driver() ?? '',
    seat: row.seat(),
    rank: row.rank(),
    laps: row.laps(),
    status: row.status(),
    lastLapUs: Number(row.lastLapUs()),
    bestLapUs: Number(row.bestLapUs()),
    raceTimeUs: Number(row.raceTimeUs()),
    gapUs: Number(row.gapUs()),
    penalties: row.penalties(),
    penaltyUs: Number(row.penaltyUs()),
    lapTimesUs: rowsOf(row.lapTimesUsLength(), (lap) => Number(row.lapTimesUs(lap))),
    parking: parking && {
      ending: parking.ending(),
      slot: parking.slot(),
      way: parking.way(),
      reversed: parking.reversed(),
      moves: parking.moves(),
    },
    planned: planned && { seconds: planned.time(), way: planned.way(), moves: planned.moves() },
    timing: timing && {
      intervalUs: Number(timing.intervalUs()),
      theoreticalUs: Number(timing.theoreticalUs()),
      lapsDown: timing.lapsDown(),
      gained: timing.gained(),
      sectorsUs: rowsOf(timing.sectorsUsLength(), (sector) => Number(timing.sectorsUs(sector))),
      sectorMerits: rowsOf(timing.sectorMeritsLength(), (sector) => timing.sectorMerits(sector)!),
      miniMerits: rowsOf(timing.miniMeritsLength(), (mini) => timing.miniMerits(mini)!),
      stints: rowsOf(timing.stintsLength(), (number) => {
        const stint = timing.stints(number)!;
        const [firstLap, laps, items] = [stint.firstLap(), stint.laps(), stint.items()];
        return { firstLap, laps, items, bestUs: Number(stint.bestUs()) };
      }),
    },
  };
}

function readEvents(buffer: ByteBuffer): Frame {
  const table = Events.getRootAsEvents(buffer);
  return {
    kind: 'events',
    epoch: table.epoch(),
    events: rowsOf(table.eventsLength(), (row) => readEvent(table, row)),
  };
}

function readEvent(table: Events, row: number): EventFrame {
  const event = table.events(row)!;
  return {
    sequence: event.sequence(),
    tick: event.tick(),
    kind: event.kind(),
    kart: event.kart(),
    other: event.other(),
    value: Number(event.value()),
  };
}

function readRays(buffer: ByteBuffer): Frame {
  const table = Rays.getRootAsRays(buffer);
  return {
    kind: 'rays',
    tick: table.tick(),
    seat: table.seat(),
    x: table.x(),
    y: table.y(),
    heading: table.heading(),
    lidarAhead: table.lidarAhead(),
    radarAhead: table.radarAhead(),
    lidarField: table.lidarField(),
    lidar: table.lidarArray() ?? NOTHING,
    radarAngles: table.radarAnglesArray() ?? NOTHING,
    radar: table.radarArray() ?? NOTHING,
    radarKinds: table.radarKindsArray() ?? [],
  };
}

function readLinks(buffer: ByteBuffer): Frame {
  const table = Links.getRootAsLinks(buffer);
  const pairs = rowsOf(table.linksLength(), (row): [number, number] => {
    const link = table.links(row)!;
    return [link.seat(), link.age()];
  });
  return { kind: 'links', ages: new Map(pairs) };
}

function readAlerts(buffer: ByteBuffer): Frame {
  const table = Alerts.getRootAsAlerts(buffer);
  const karts = rowsOf(table.kartsLength(), (row) => {
    const kart = table.karts(row)!;
    return alertOf(kart.seat(), kart);
  });
  return { kind: 'alerts', tick: table.tick(), karts };
}

function readOwnAlert(buffer: ByteBuffer): Frame {
  const said = AlertMessage.getRootAsAlertMessage(buffer).alert()!;
  return { kind: 'own alert', alert: alertOf(-1, said) };
}

function readOwnPose(buffer: ByteBuffer): Frame {
  const pose = PoseMessage.getRootAsPoseMessage(buffer).pose()!;
  const [speed, deviation, quality] = [pose.speed(), pose.deviation(), pose.quality()];
  return { kind: 'own pose', speed, deviation, quality };
}

type Said = NonNullable<ReturnType<AlertMessage['alert']> | ReturnType<Alerts['karts']>>;

function alertOf(seat: number, said: Said): KartAlert {
  return {
    seat,
    stage: said.stage(),
    cause: said.cause(),
    hit: said.kind(),
    advice: said.advice(),
    bearing: said.bearing(),
    distance: said.distance(),
    time: said.time(),
    needed: said.needed(),
  };
}

function readHud(buffer: ByteBuffer): Frame {
  const table = Hud.getRootAsHud(buffer);
  return {
    kind: 'hud',
    immune: table.immune(),
    effects: rowsOf(table.effectsLength(), (row) => readEffect(table, row)),
    flag: table.flag(),
    isLed: table.led(),
  };
}

function readEffect(table: Hud, row: number): EffectFrame {
  const effect = table.effects(row)!;
  return { item: effect.item(), remaining: effect.remaining() };
}

function readBriefing(buffer: ByteBuffer): Frame {
  const table = Briefing.getRootAsBriefing(buffer);
  const names = rowsOf(table.vehicleNamesLength(), (row) => table.vehicleNames(row));
  return {
    kind: 'briefing',
    seat: table.seat(),
    epoch: table.epoch(),
    laps: table.laps(),
    items: rowsOf(table.itemsLength(), (row) => table.items(row)),
    vehicle: table.vehicle() ?? '',
    numbers: new Map(names.map((name, row) => [name, table.vehicleValues(row) ?? 0])),
  };
}
