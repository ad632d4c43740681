// The round trip of a driver's control: from sending it until a snapshot says
// that the server accepted it.

const MOST_SENT = 240;
const SHARE = 0.2; // of a new measurement in the average

interface Sent {
  sequence: number;
  atMs: number;
}

export class Response {
  ms = NaN;
  private sent: Sent[] = [];

  noteSent(sequence: number, atMs: number): void {
    this.sent.push({ sequence, atMs });
    if (this.sent.length > MOST_SENT) this.sent.shift();
  }

  noteAcknowledged(sequence: number, atMs: number): void {
    const index = this.sent.findIndex((sent) => sent.sequence === sequence);
    if (index < 0) return;
    const ms = atMs - this.sent[index]!.atMs;
    this.ms = Number.isNaN(this.ms) ? ms : this.ms + SHARE * (ms - this.ms);
    this.sent.splice(0, index + 1);
  }
}
