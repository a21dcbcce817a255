// Entries of the appliance log as rows (docs/reference/format.md, "The appliance log"). Pure.

/** Whatever else it carries stands beside these. */
export interface LogEntry {
  type: string;
  seq: number;
  utc: string;
  [key: string]: unknown;
}

export const kLogTypes = [
  'access', 'case-opened', 'case-checkpoint', 'case-closed', 'plan-sealed', 'replicated', 'erased', 'boot', 'shutdown', 'config-changed', 'device-key-changed',
  'pre-roll-discarded', 'recovered',
] as const;

const kOwnColumns = new Set(['type', 'seq', 'utc', 'mono_ns', 'case', 'who', 'what']);

export interface LogRow {
  seq: number;
  utc: string;
  type: string;
  /** "" where it concerns no single case. */
  case: string;
  who: string;
  /** In the words of whoever entered it, or what it carries: "size 412". */
  what: string;
}

const text = (value: unknown): string => (typeof value === 'string' ? value : JSON.stringify(value));

export function rowOf(entry: LogEntry): LogRow {
  const named = typeof entry['case'] === 'string' && entry['case'] !== '*' ? entry['case'] : '';
  const carried = Object.entries(entry)
    .filter(([key]) => !kOwnColumns.has(key))
    .map(([key, value]) => `${key} ${text(value)}`);
  return {
    seq: entry.seq,
    utc: entry.utc,
    type: entry.type,
    case: named,
    who: typeof entry['who'] === 'string' ? entry['who'] : '',
    what: [...(typeof entry['what'] === 'string' ? [entry['what']] : []), ...carried].join(', '),
  };
}
