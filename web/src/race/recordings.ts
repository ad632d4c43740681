// The recordings that the gateway can play.

import { tokenFor } from '../address.svelte';
import type { RecordingEntry } from '../wire/protocol';

/** Returns all recordings, newest first. */
export async function allRecordings(): Promise<RecordingEntry[]> {
  const token = tokenFor('spectate');
  const answer = await fetch(
    'recordings',
    token ? { headers: { Authorization: `Bearer ${token}` } } : {},
  );
  if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
  return (await answer.json()) as RecordingEntry[];
}

/** Returns the name of the newest recording of a session, '' if there is none. */
export async function recordingOf(session: string): Promise<string> {
  try {
    const all = await allRecordings();
    return all.find(({ name }) => name.startsWith(`${session}-`))?.name ?? '';
  } catch {
    return ''; // the command then shows a placeholder
  }
}
