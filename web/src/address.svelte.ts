// The part of the address after #: a view, and tokens, which the browser does not send anywhere.

import { SvelteMap } from 'svelte/reactivity';

import type { Hello, Role } from './wire/protocol';

export type View = 'watch' | 'timing' | 'drive' | 'beside' | 'steward' | 'replay';

export interface Place {
  view: View;
  recording: string; // '' for the list of them
  showsStats: boolean;
}

const ROLE_VIEWS: Record<Role, View> = {
  spectate: 'watch',
  drive: 'drive',
  companion: 'beside',
  steward: 'steward',
};
const VIEW_ROLES: Record<View, Role> = {
  watch: 'spectate',
  timing: 'spectate',
  drive: 'drive',
  beside: 'companion',
  steward: 'steward',
  replay: 'spectate',
};
// The token of each role; kept for this tab.
const tokens = new SvelteMap<Role, string>();
let place = $state.raw<Place>(take());

addEventListener('hashchange', () => (place = take()));

export function currentPlace(): Place {
  return place;
}

export function goTo(view: View, recording = ''): void {
  const stats = place.showsStats ? '&stats=1' : '';
  location.hash = (view === 'replay' ? `replay=${encodeURIComponent(recording)}` : view) + stats;
}

export function roleOf(view: View): Role {
  return VIEW_ROLES[view];
}

export function tokenFor(role: Role): string {
  return tokens.get(role) ?? sessionStorage.getItem(`race.token.${role}`) ?? '';
}

/** Keeps a token, '' for one that was refused: the page then asks for another. */
export function keepToken(role: Role, token: string): void {
  tokens.set(role, token);
  sessionStorage.setItem(`race.token.${role}`, token);
}

/** Keeps the choices of a driver, so that a page that is reloaded gets its seat back. */
export function keepHello(hello: Hello | null): void {
  if (hello) sessionStorage.setItem('race.seat', JSON.stringify(hello));
  else sessionStorage.removeItem('race.seat');
}

export function keptHello(): Hello | null {
  const kept = sessionStorage.getItem('race.seat');
  if (!kept) return null;
  const hello = JSON.parse(kept) as Hello;
  // The address may have brought the token of another driver.
  return hello.token === tokenFor(hello.role) ? hello : null;
}

/** Reads the address, keeps its token and removes it, so that it is not visible there. */
function take(): Place {
  const asked = parse(location.hash);
  if (asked.token) {
    keepToken(asked.role, asked.token);
    const stats = asked.place.showsStats ? '&stats=1' : '';
    history.replaceState(null, '', `#${asked.place.view}${stats}`);
  }
  return asked.place;
}

interface Asked {
  place: Place;
  role: Role;
  token: string;
}

/** Returns the contents of the part of an address after #. */
export function parse(hash: string): Asked {
  const parts = new URLSearchParams(hash.replace(/^#/, ''));
  const wanted = parts.get('role');
  const role = isRole(wanted) ? wanted : null;
  const views = ['watch', 'timing', 'drive', 'beside', 'steward'] as const;
  const named = views.find((view) => parts.has(view));
  const view = parts.has('replay') ? 'replay' : (named ?? (role ? ROLE_VIEWS[role] : 'watch'));
  return {
    place: {
      view,
      recording: parts.get('replay') ?? '',
      showsStats: parts.get('stats') === '1',
    },
    role: role ?? VIEW_ROLES[view],
    token: parts.get('token') ?? '',
  };
}

function isRole(word: string | null): word is Role {
  return word !== null && Object.hasOwn(ROLE_VIEWS, word);
}
