// The generated readers and writers that the page uses, whatever folders flatc puts them in.
export { Control } from './generated/race-server/wire/generated/drive/control.js';
export { ControlMessage } from './generated/race-server/wire/generated/drive/control-message.js';
export { Hud } from './generated/race-server/wire/generated/drive/hud.js';
export { Briefing } from './generated/race-server/wire/generated/session/briefing.js';
export { Course } from './generated/race-server/wire/generated/session/course.js';
export { Line } from './generated/race-server/wire/generated/session/line.js';
export { Rules } from './generated/race-server/wire/generated/session/rules.js';
export { Events } from './generated/race-server/wire/generated/spectate/events.js';
export { Links } from './generated/race-server/wire/generated/spectate/links.js';
export { Rays } from './generated/race-server/wire/generated/spectate/rays.js';
export { Snapshot } from './generated/race-server/wire/generated/spectate/snapshot.js';
export { Standings } from './generated/race-server/wire/generated/spectate/standings.js';
