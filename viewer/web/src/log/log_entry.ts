// Entries of the appliance log as rows (docs/reference/format.md, "The appliance log"). Pure.

import type { LogEntry } from '@/api/types';
import { formatDuration } from '@/base/time';

export const kLogTypes = [
  'access',
  'case-opened',
  'case-checkpoint',
  'case-closed',
  'plan-sealed',
  'replicated',
  'erased',
  'case-held',
  'case-released',
  'consent-given',
  'consent-withdrawn',
  'boot',
  'shutdown',
  'config-changed',
  'device-key-changed',
  'device-ml-dsa-added',
  'device-hardware-added',
  'device-attestation-added',
  'device-hardware-silent',
  'pre-roll-discarded',
  'recovered',
  'damage-found',
] as const;

/** What belongs to a quote and is for verifiers is left out, too: its signature, and the registers. */
const kOwnColumns = new Set(['type', 'seq', 'utc', 'mono_ns', 'case', 'who', 'what', 'quote_signature', 'pcrs']);

export interface LogRow {
  seq: number;
  utc: string;
  type: string;
  /** "" where it concerns no single case. */
  case: string;
  who: string;
  /** What was done, in the entry's own words; "" where it is no access. */
  deed: string;
  /** Whatever else it carries, in its order. */
  carries: readonly (readonly [field: string, value: string])[];
}

/** Of what the entry carries beside its own columns, what is a length in nanoseconds. */
const kLengths = new Set(['duration_ns']);
/** Base64 of some hundred bytes, of which the beginning tells one from another. */
const kBytes = new Set(['quote', 'attestation']);
const kBytesShown = 16;

function text(field: string, value: unknown): string {
  if (kLengths.has(field) && typeof value === 'number') return formatDuration(value);
  if (kBytes.has(field) && typeof value === 'string' && value.length > kBytesShown) return `${value.slice(0, kBytesShown)}…`;
  return typeof value === 'string' ? value : JSON.stringify(value);
}

export function rowOf(entry: LogEntry): LogRow {
  const named = typeof entry['case'] === 'string' && entry['case'] !== '*' ? entry['case'] : '';
  const carried = Object.entries(entry)
    .filter(([key]) => !kOwnColumns.has(key))
    .map(([key, value]) => [key, text(key, value)] as const);
  return {
    seq: entry.seq,
    utc: entry.utc,
    type: entry.type,
    case: named,
    who: typeof entry['who'] === 'string' ? entry['who'] : '',
    deed: typeof entry['what'] === 'string' ? entry['what'] : '',
    carries: carried,
  };
}
