// Messages of an event of several races, from bytes to plain data.

import type { ByteBuffer } from 'flatbuffers';

import type { CallFrame, GhostFrame, TeamFrame } from './eventFrames';
import type { Frame } from './frames';
import type { Call } from './generated/spectate/call.js';
import type { Ghost } from './generated/spectate/ghost.js';
import type { Team } from './generated/spectate/team.js';
import { rowsOf } from './rows';
import { Ghosts, Programme } from './tables';

export function readProgramme(buffer: ByteBuffer): Frame {
  const table = Programme.getRootAsProgramme(buffer);
  const now = table.now();
  return {
    kind: 'programme',
    event: table.event() ?? '',
    title: table.title() ?? '',
    stage: table.stage() ?? '',
    phase: table.phase(),
    now: now && readCall(now),
    limitS: table.limit(),
    untilMs: Number(table.untilUs()) / 1000,
    driven: table.driven(),
    drives: table.drives(),
    hasPoints: table.hasPoints(),
    attempts: table.attempts(),
    coming: rowsOf(table.comingLength(), (row) => readCall(table.coming(row)!)),
    teams: rowsOf(table.teamsLength(), (row) => readTeam(table.teams(row)!)),
    protests: rowsOf(table.protestsLength(), (row) => {
      const protest = table.protests(row)!;
      return {
        number: protest.number(),
        title: protest.title() ?? '',
        by: protest.by() ?? '',
        against: protest.against() ?? '',
        why: protest.why() ?? '',
        outcome: protest.outcome() ?? '',
      };
    }),
  };
}

function readCall(call: Call): CallFrame {
  return {
    title: call.title() ?? '',
    teams: rowsOf(call.teamsLength(), (row) => call.teams(row)),
  };
}

function readTeam(team: Team): TeamFrame {
  return {
    name: team.name() ?? '',
    seat: team.seat(),
    place: team.place(),
    points: team.points(),
    timeUs: Number(team.timeUs()),
    attemptsUs: rowsOf(team.attemptsUsLength(), (row) => Number(team.attemptsUs(row))),
    attemptsLeft: team.attemptsLeft(),
    deleted: rowsOf(team.deletedLength(), (row) => {
      const lap = team.deleted(row)!;
      return { attempt: lap.attempt(), lap: lap.lap(), why: lap.why() ?? '' };
    }),
    remark: team.remark() ?? '',
    canChange: team.canChange(),
  };
}

export function readGhosts(buffer: ByteBuffer): Frame {
  const table = Ghosts.getRootAsGhosts(buffer);
  return {
    kind: 'ghosts',
    epoch: table.epoch(),
    ghosts: rowsOf(table.ghostsLength(), (row) => readGhost(table.ghosts(row)!)),
  };
}

function readGhost(ghost: Ghost): GhostFrame {
  return {
    team: ghost.team() ?? '',
    seat: ghost.seat(),
    isBest: ghost.isBest(),
    fromLights: ghost.fromLights(),
    timeUs: Number(ghost.timeUs()),
    seconds: ghost.timeArray() ?? [],
    x: ghost.xArray() ?? [],
    y: ghost.yArray() ?? [],
    distance: ghost.distanceArray() ?? [],
  };
}
