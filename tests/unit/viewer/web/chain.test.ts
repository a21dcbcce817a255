import { describe, expect, it } from 'vitest';
import type { Finding, Severity, Timeline, VerificationReport } from '@/api/types';
import { readFileSync } from 'node:fs';
import { messages } from '@/i18n/messages';
import { byGravity, chainOf, isThereByThen, linkOf, momentOf, wordsOfChain, wordsOfTime } from '@/verification/chain';

const finding = (code: string, severity: Severity, more: Partial<Finding> = {}): Finding => ({
  code,
  severity,
  file: null,
  entry: null,
  offset: null,
  text: code,
  meaning: { en: code, ja: code },
  ...more,
});
const report = (findings: Finding[], more: Partial<VerificationReport> = {}): VerificationReport => ({
  state: 'done',
  verified: '2026-08-05T09:15:02.000000Z',
  case: 'c',
  verdict: 'intact',
  time: 'external',
  outside_entries: 9,
  device: '',
  signatures: 'ed25519',
  opened: null,
  closed: null,
  entries: 9,
  files: 9,
  bytes: 9,
  signed_entries: 9,
  checkpoints: 2,
  tokens: 2,
  excerpt: null,
  log: null,
  proved_entries: 0,
  contents: null,
  evidence: null,
  witnesses: null,
  streams: [],
  brackets: [],
  authorities: [],
  clocks: [],
  findings,
  ...more,
});
const states = (one: VerificationReport) => Object.fromEntries(chainOf(one).map((link) => [link.name, link.state]));

describe('The chain of proof', () => {
  it('says nothing of signatures where nobody signed', () => {
    const unsigned = report([], { signatures: 'none', signed_entries: 0, checkpoints: 0 });
    expect(states(unsigned)).toMatchObject({ segments: 'open', ledger: 'open', checkpoints: 'open', tokens: 'holds' });
  });

  it('says whose clock stands behind its time, and whether a device signed it', () => {
    const kTimes = ['external', 'external-in-part', 'self-issued', 'none'] as const;
    const told = (time: (typeof kTimes)[number], more: Partial<VerificationReport> = {}) =>
      wordsOfChain(report([], { time, ...more }))
        .map((key) => messages.en[key])
        .join(' ');
    expect(told('external')).toContain('an outside authority says by when');
    expect(told('external-in-part')).toContain('Of the later ones nobody outside');
    expect(told('self-issued')).toContain('No outside clock stands behind it');
    expect(told('none')).toContain('No time-stamp here shows');
    for (const time of kTimes) {
      expect(told(time)).toContain('the device signs the ledger');
      expect(told(time, { signed_entries: 0 })).not.toContain('signs the ledger');
      expect(told(time).includes('an outside authority says by when')).toBe(time === 'external');
    }
  });

  it('says of a later format that nothing was checked, not that nobody signed', () => {
    const newer = report([finding('format-newer', 'unproven')], { time: 'none', signed_entries: 0 });
    expect(wordsOfChain(newer)).toEqual(['chain.newer', 'chain.choose']);
  });

  it('says beside the time what it is not worth', () => {
    const told = (...codes: string[]) => wordsOfTime(report(codes.map((code) => finding(code, 'note'))));
    expect(told('frames-dropped')).toEqual(['timeWhat.external']);
    expect(told('stamped-after-close')).toEqual(['timeWhat.external-until', 'timeRemark.stamped-after-close']);
    expect(told('clock-differs', 'first-stamped-late')).toEqual(['timeWhat.external', 'timeRemark.first-stamped-late', 'timeRemark.clock-differs']);
    expect(told('segments-entered-late')).toEqual(['timeWhat.external', 'timeRemark.segments-entered-late']);
    expect(told('end-stamped-late', 'close-utc-differs')).toEqual(['timeWhat.external', 'timeRemark.end-stamped-late', 'timeRemark.close-utc-differs']);
    const selfIssued = report([finding('close-utc-differs', 'note')], { time: 'self-issued' });
    expect(wordsOfTime(selfIssued)).toEqual(['timeWhat.self-issued', 'timeRemark.close-utc-differs']);
    expect(isThereByThen(selfIssued)).toBe(false);
    expect(isThereByThen(report([finding('stamped-after-close', 'note')]))).toBe(true);
    expect(messages.en['timeWhat.external-until']).not.toContain('proven by');
  });

  it('holds where nothing was found', () => {
    expect(states(report([]))).toEqual({ segments: 'holds', ledger: 'holds', checkpoints: 'holds', tokens: 'holds', authority: 'holds' });
  });
  it('breaks where the finding is, and nowhere else', () => {
    expect(states(report([finding('file-hash-differs', 'tampered', { file: 'segments/endoscope/00000003.ts.age' })]))).toEqual({
      segments: 'broken',
      ledger: 'holds',
      checkpoints: 'holds',
      tokens: 'holds',
      authority: 'holds',
    });
    expect(states(report([finding('log-end-differs', 'tampered')]))).toMatchObject({ ledger: 'broken', segments: 'holds' });
    expect(states(report([finding('checkpoint-signature-invalid', 'tampered')]))).toMatchObject({ checkpoints: 'broken' });
  });
  it('says what cannot be shown', () => {
    expect(states(report([], { tokens: 0, time: 'none' }))).toMatchObject({ tokens: 'open', authority: 'open' });
    expect(states(report([], { time: 'external-in-part' }))).toMatchObject({ tokens: 'holds', authority: 'open' });
    expect(states(report([], { time: 'self-issued' }))).toMatchObject({ tokens: 'holds', authority: 'open' });
    expect(states(report([finding('no-trusted-authority', 'unproven')], { time: 'none' }))).toMatchObject({ authority: 'open', tokens: 'open' });
    expect(states(report([], { signed_entries: 7 }))).toMatchObject({ ledger: 'open', segments: 'holds' });
    expect(states(report([finding('gap', 'gap'), finding('clock-stepped', 'note')]))).toMatchObject({ segments: 'partly', ledger: 'holds' });
  });
  it('says of nothing that it holds by lines that were changed, or that nobody could read', () => {
    const open = { segments: 'open', tokens: 'open', authority: 'open' };
    expect(states(report([finding('ledger-changed', 'tampered')]))).toMatchObject({ ...open, ledger: 'broken' });
    expect(states(report([finding('checkpoint-signature-invalid', 'tampered')]))).toMatchObject({ ...open, ledger: 'open', checkpoints: 'broken' });
    expect(states(report([finding('excerpt-malformed', 'tampered'), finding('gap', 'gap')]))).toMatchObject({ ...open, ledger: 'broken' });
    expect(states(report([finding('token-repeated', 'tampered')]))).toMatchObject({ segments: 'open', tokens: 'broken', ledger: 'holds', authority: 'open' });
    expect(states(report([finding('stream-unknown', 'tampered')]))).toMatchObject({ ...open, ledger: 'broken' });
    expect(states(report([finding('outside-note-invalid', 'unproven')]))).toMatchObject({ ledger: 'open', checkpoints: 'holds' });
    expect(states(report([finding('folder-of-another-case', 'unproven')]))).toMatchObject({ segments: 'open', ledger: 'holds' });
    expect(states(report([finding('excerpt-no-later-token', 'unproven')]))).toMatchObject({ tokens: 'open', authority: 'open' });
    expect(states(report([finding('token-refused', 'tampered')]))).toMatchObject({ tokens: 'broken', authority: 'open' });
    // What is broken stays so.
    expect(
      states(report([finding('ledger-changed', 'tampered'), finding('file-missing', 'tampered', { file: 'segments/room/00000001.ts.age' })])),
    ).toMatchObject({ ledger: 'broken', segments: 'broken' });
  });
  it('says of the case no more than of the log beside it', () => {
    const ofLog = (code: string, severity: Severity, file: string) => states(report([finding(code, severity, { file: `log/${file}`, of: 'log' })]));
    const open = { segments: 'holds', ledger: 'open', checkpoints: 'holds', tokens: 'holds', authority: 'holds' };
    expect(ofLog('log-not-sound', 'unproven', 'ledger.jsonl')).toEqual(open);
    expect(ofLog('log-silent', 'unproven', 'ledger.jsonl')).toEqual(open);
    expect(ofLog('file-unreadable', 'unproven', 'checkpoints/00000004.note')).toEqual(open);
    expect(ofLog('device-not-trusted', 'unproven', '')).toEqual(open);
    expect(ofLog('log-not-tidy', 'note', '.DS_Store')).toEqual({ ...open, ledger: 'holds' });
    expect(ofLog('file-hash-differs', 'tampered', 'consents/x.age')).toEqual({ ...open, ledger: 'broken' });
    // A folder of the case that is called so is none of the log.
    expect(states(report([finding('file-unnamed', 'tampered', { file: 'log/x' })]))).toMatchObject({ segments: 'broken', ledger: 'holds' });
  });
  it('says of a case without streams that its segments are open', () => {
    expect(states(report([finding('no-stream', 'unproven', { file: 'ledger.jsonl' })]))).toMatchObject({ segments: 'open', ledger: 'holds' });
  });
  it('says of nothing that it holds where an algorithm ended', () => {
    expect(new Set(Object.values(states(report([finding('algorithm-ended', 'unproven')]))))).toEqual(new Set(['open']));
  });
  it('takes the gravest of a link', () => {
    expect(states(report([finding('gap', 'gap'), finding('segment-hole', 'tampered')]))).toMatchObject({ segments: 'broken' });
  });
  it('puts a damaged file to the link it belongs to', () => {
    expect(linkOf(finding('file-hash-differs', 'tampered', { file: 'tokens/00000042.embedded.tsr' }))).toBe('tokens');
    expect(linkOf(finding('file-missing', 'tampered', { file: 'checkpoints/00000042.note' }))).toBe('checkpoints');
    expect(linkOf(finding('file-unreadable', 'unproven', { file: 'ledger.jsonl' }))).toBe('ledger');
  });
  it('puts every finding of the format somewhere on purpose', () => {
    const format = process.env['KIROKU_SOURCE_DIR'];
    if (!format) throw new Error('KIROKU_SOURCE_DIR names the checkout');
    const codes = [
      ...readFileSync(`${format}/docs/reference/format.md`, 'utf8').matchAll(/^\| `([a-z-]+)` \| (?:tampered|incomplete|unproven|gap|note) \|/gm),
    ].map((one) => one[1]!);
    expect(codes.length).toBeGreaterThan(70);
    const ofLedger = codes.filter((code) => linkOf(finding(code, 'note')) === 'ledger');
    // What is left to the ledger is about its lines, the appliance log, consents and boots in it, excerpts, a case that carries on another, what another device states of it, and the list itself.
    expect(
      ofLedger.filter(
        (code) =>
          !/^(entry|format-newer|open|close-utc|ledger|log|outside|stream-unknown|excerpt|case|device-invalid|clock|utc|not-closed|recovered|carrying-on|carried-on|store-statement|consent|boots?-|measured-boot|access-without-consent|folder|more)/.test(
            code,
          ),
      ),
    ).toEqual([]);
  });
});

describe('Findings', () => {
  it('stand with the gravest first, else as they were found', () => {
    const list = [finding('a', 'note'), finding('b', 'tampered'), finding('c', 'gap'), finding('d', 'tampered')];
    expect(byGravity(list).map((one) => one.code)).toEqual(['b', 'd', 'c', 'a']);
  });
  it('lead to their moment', () => {
    const timeline: Timeline = {
      segments: [{ stream: 'room', index: 3, start_ns: 6e9, end_ns: 8e9, complete: true, erased: false }],
      gaps: [],
      tokens: [],
      checkpoints: [],
      brackets: [],
      proofs_coming: false,
    };
    expect(momentOf(finding('gap', 'gap', { time_ns: 0 }), timeline)).toBe(0);
    expect(momentOf(finding('file-hash-differs', 'tampered', { file: 'segments/room/00000003.ts.age', time_ns: null }), timeline)).toBe(6e9);
    expect(momentOf(finding('file-hash-differs', 'tampered', { file: 'segments/room/00000004.ts.age' }), timeline)).toBeUndefined();
    expect(momentOf(finding('log-not-tidy', 'note', { file: 'log/segments/room/00000003.ts.age', of: 'log' }), timeline)).toBeUndefined();
    expect(momentOf(finding('no-token', 'unproven'), timeline)).toBeUndefined();
  });
});
