// What race control and real karts tell of a race, oldest first.

import type { AlertsFrame, EventFrame, EventsFrame } from '../wire/frames';
import { type ToldAlert, isNews } from './alerts';

const MOST_EVENTS = 400;
const MOST_ALERTS = 100;

export class News {
  events = $state.raw<readonly EventFrame[]>([]);
  alerts = $state.raw<readonly ToldAlert[]>([]); // what real karts said
  private epoch = -1; // of the events
  private last = 0; // number of the newest alert: below zero, where events have none
  private seen = new Set<number>();

  takeEvents(frame: EventsFrame): void {
    if (frame.epoch !== this.epoch) {
      this.forget();
      this.epoch = frame.epoch;
    }
    const fresh = frame.events.filter((event) => !this.seen.has(event.sequence));
    if (!fresh.length) return;
    for (const event of fresh) {
      this.seen.add(event.sequence);
    }
    const all = [...this.events, ...fresh].sort((one, other) => one.sequence - other.sequence);
    this.events = all.slice(-MOST_EVENTS);
  }

  takeAlerts(frame: AlertsFrame): void {
    const fresh = frame.karts.filter((alert) => isNews(alert, frame.tick, this.alerts));
    if (!fresh.length) return;
    const told = fresh.map((alert) => ({ tick: frame.tick, number: --this.last, alert }));
    this.alerts = [...this.alerts, ...told].slice(-MOST_ALERTS);
  }

  forget(): void {
    this.events = [];
    this.alerts = [];
    this.seen = new Set();
  }

  /** Forgets what was told, unless it is of this epoch of the server. */
  forgetOthers(epoch: number): void {
    if (epoch !== this.epoch) this.forget();
  }
}
