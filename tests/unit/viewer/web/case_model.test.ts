import { describe, expect, it } from 'vitest';
import type { CaseInfo, Timeline } from '@/api/types';
import { caseModel } from '@/views/case_model';

const kInfo = JSON.parse('{"begins_ns": 0, "duration_ns": 1000000000, "streams": [{"name": "room", "kind": "video"}]}') as CaseInfo;

/** Segments of a second each, as many as a case of days has. */
const timelineOf = (count: number): Timeline => ({
  segments: Array.from({ length: count }, (_, index) => ({
    stream: 'room',
    index,
    start_ns: index * 1e9,
    end_ns: (index + 1) * 1e9,
    complete: true,
    erased: false,
  })),
  gaps: [],
  tokens: [],
  checkpoints: [],
  brackets: [],
  proofs_coming: false,
});

describe('A case as its view needs it', () => {
  it('ends with its last segment, however many there are', () => {
    expect(caseModel(kInfo, timelineOf(400_000)).whole).toEqual({ start_ns: 0, end_ns: 400_000e9 });
  });
  it('lasts as long as its ledger says, and a second at least', () => {
    expect(caseModel({ ...kInfo, duration_ns: 5e9 }, timelineOf(2)).whole.end_ns).toBe(5e9);
    expect(caseModel({ ...kInfo, duration_ns: 0 }, timelineOf(0)).whole.end_ns).toBe(1e9);
  });
});
