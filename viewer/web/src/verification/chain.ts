// What a verification found, as links of the chain that proof hangs on: segments are hashed into the ledger, the ledger's state is signed as a checkpoint,
// a token says when the checkpoint existed, and an authority stands behind the token. Pure functions.
import type { Finding, Severity, Timeline, VerificationReport } from '@/api/types';
import type { MessageKey } from '@/i18n/messages';

export type LinkName = 'segments' | 'ledger' | 'checkpoints' | 'tokens' | 'authority';
export const kLinks: readonly LinkName[] = ['segments', 'ledger', 'checkpoints', 'tokens', 'authority'];

/** holds: nothing against it; partly: true with stated gaps; open: cannot be known; broken: something does not hold. */
export type LinkState = 'holds' | 'partly' | 'open' | 'broken';

export interface ChainLink {
  name: LinkName;
  state: LinkState;
  findings: Finding[];
}

// The codes of docs/reference/format.md, "Findings", by what they are about.
const kByCode: Record<string, LinkName> = {
  'device-not-trusted': 'checkpoints',
  'no-trusted-device': 'checkpoints',
  'device-file-differs': 'checkpoints',
  'device-ml-dsa-differs': 'checkpoints',
  'device-hardware-differs': 'checkpoints',
  'device-attestation-differs': 'checkpoints',
  'ledger-not-covered': 'checkpoints',
  'close-not-covered': 'checkpoints',
  'end-not-covered': 'checkpoints',
  'log-checkpoint-differs': 'checkpoints',
  'log-algorithm-ended': 'checkpoints',
  'log-doubted': 'checkpoints',
  'no-trusted-authority': 'authority',
  'token-untrusted': 'authority',
  'second-token-untrusted': 'authority',
  'no-token': 'tokens',
  'excerpt-no-later-token': 'tokens',
  'end-not-stamped': 'tokens',
  'end-stamped-late': 'tokens',
  'stamped-after-close': 'tokens',
  'first-stamped-late': 'tokens',
  'segments-entered-late': 'tokens',
  'clock-contradicted': 'tokens',
  'authority-clock-differs': 'tokens',
  'authority-clock-set': 'tokens',
  'clock-disagreement': 'tokens',
  'authorities-disagree': 'tokens',
  'stream-unknown': 'ledger',
  'no-stream': 'segments',
  gap: 'segments',
  'sound-gap': 'segments',
  'gap-beyond-end': 'segments',
  'monitor-silent': 'segments',
  'frames-dropped': 'segments',
  'part-file': 'segments',
  'folder-of-another-case': 'segments',
  'folder-name-differs': 'segments',
  'name-clash': 'segments',
  'totals-differ': 'segments',
};
const kByPrefix: readonly [string, LinkName][] = [
  ['segment', 'segments'],
  ['event-', 'segments'],
  ['events-', 'segments'],
  ['subject-', 'segments'],
  ['stream', 'segments'],
  ['file-', 'segments'],
  ['erased-', 'segments'],
  ['rekeyed-', 'segments'],
  ['checkpoint-', 'checkpoints'],
  ['log-proof-', 'checkpoints'],
  ['authority-', 'authority'],
  ['token-', 'tokens'],
];

/** Of the appliance log beside the case: it says nothing of the case's own files. */
const isOfLog = (finding: Finding): boolean => finding.of === 'log';

export function linkOf(finding: Finding): LinkName {
  const exact = kByCode[finding.code];
  if (exact && !(isOfLog(finding) && !finding.code.startsWith('log-'))) return exact;
  if (isOfLog(finding)) return 'ledger';
  // A file that is missing or changed breaks the link it belongs to.
  if (finding.code.startsWith('file-') && finding.file) {
    if (/(^|\/)tokens\//.test(finding.file)) return 'tokens';
    if (/(^|\/)checkpoints\//.test(finding.file)) return 'checkpoints';
    if (/(^|\/)ledger\.jsonl$/.test(finding.file)) return 'ledger';
  }
  return kByPrefix.find(([prefix]) => finding.code.startsWith(prefix))?.[1] ?? 'ledger';
}

const kStates: Record<Severity, LinkState> = { tampered: 'broken', incomplete: 'open', unproven: 'open', gap: 'partly', note: 'holds' };
const kGrave: readonly LinkState[] = ['holds', 'partly', 'open', 'broken'];

export function chainOf(report: VerificationReport): ChainLink[] {
  const chain = kLinks.map((name) => {
    const findings = report.findings.filter((finding) => linkOf(finding) === name);
    const state = findings.reduce<LinkState>((worst, finding) => {
      const its = kStates[finding.severity];
      return kGrave.indexOf(its) > kGrave.indexOf(worst) ? its : worst;
    }, 'holds');
    return { name, state: holds(state) && (nothingBehind(name, report) || restsOnWhatFails(name, report)) ? ('open' as const) : state, findings };
  });
  // An authority stands behind its time-stamps alone.
  const stamped = chain.some((link) => link.name === 'tokens' && holds(link.state));
  return chain.map((link) => (link.name === 'authority' && holds(link.state) && !stamped ? { ...link, state: 'open' } : link));
}

const holds = (state: LinkState): boolean => state === 'holds' || state === 'partly';

// Here as in a report (viewer/report/checks.cpp): of one case both must not answer otherwise.

/** Where these were found, files were not looked for: their entries cannot be read, or may not name them. */
const kLeavesFilesUnasked: ReadonlySet<string> = new Set([
  'entry-malformed',
  'entry-too-long',
  'ledger-unreadable',
  'stream-unknown',
  'segment-name-differs',
  'token-name-differs',
  'token-repeated',
  'token-covers-later',
]);

/** What others say about the ledger, which the page puts to it: it does not change its lines. */
const kOfOthers = /^(log|consent|access|boot|measured-boot|case-missing|erased-while)/;

/** Whether the ledger's lines are not what was signed: then nobody signed which files there were, and what was stamped were other lines. */
const isLedgerChanged = (report: VerificationReport): boolean =>
  report.findings.some(
    (one) => one.severity === 'tampered' && !kOfOthers.test(one.code) && !isOfLog(one) && (linkOf(one) === 'ledger' || /^(checkpoint|outside)-/.test(one.code)),
  );

/** Whether what the link says is true only if something holds that does not. */
function restsOnWhatFails(name: LinkName, report: VerificationReport): boolean {
  if (name !== 'checkpoints' && isLedgerChanged(report)) return true;
  if (name === 'segments' && report.findings.some((one) => kLeavesFilesUnasked.has(one.code))) return true;
  // Whoever can find another text with the same hash, or sign in the device's name, can write all of it anew.
  return report.findings.some((one) => one.code === 'algorithm-ended');
}

/** What anybody can have made where the device signed nothing. */
const kOfTheDevice: readonly LinkName[] = ['segments', 'ledger', 'checkpoints'];

const nothingBehind = (name: LinkName, report: VerificationReport): boolean =>
  (kOfTheDevice.includes(name) && report.signed_entries === 0) ||
  (name === 'ledger' && report.excerpt === null && report.signed_entries < report.entries) ||
  (name === 'tokens' && (report.tokens === 0 || report.time === 'none')) ||
  (name === 'authority' && report.time !== 'external');

// What limits the worth of a case's times, as every reader says it beside the time (archive/verify/report.h, TimeRemark).
const kTimeRemarks = ['stamped-after-close', 'first-stamped-late', 'segments-entered-late', 'end-stamped-late', 'clock-differs', 'close-utc-differs'] as const;

const isFound = (report: VerificationReport, code: string): boolean => report.findings.some((one) => one.code === code);

/** Whether it is proved by when the record was there, and nothing outside says when it was made. */
export const isThereByThen = (report: VerificationReport): boolean => report.time === 'external' && isFound(report, 'stamped-after-close');

/** Whose clock says when the case was recorded, in sentences, and what limits the worth of that. */
export const wordsOfTime = (report: VerificationReport): MessageKey[] => [
  isThereByThen(report) ? 'timeWhat.external-until' : `timeWhat.${report.time}`,
  ...kTimeRemarks.filter((code) => isFound(report, code)).map((code) => `timeRemark.${code}` as const),
];

/** What such a record's entries say was not read: neither that somebody signed it, nor that nobody did. */
const isOfLaterFormat = (report: VerificationReport): boolean => report.findings.some((one) => one.code === 'format-newer' && !isOfLog(one));

/** What the chain is made of, in sentences: who signed it, and whose clock stands behind its time. */
export const wordsOfChain = (report: VerificationReport): MessageKey[] =>
  isOfLaterFormat(report)
    ? ['chain.newer', 'chain.choose']
    : [report.signed_entries === 0 ? 'chain.unsigned' : 'chain.what', `chainTime.${report.time}`, 'chain.choose'];

const kOrder: readonly Severity[] = ['tampered', 'incomplete', 'unproven', 'gap', 'note'];

/** The gravest first; of one severity in the report's order. */
export const byGravity = (findings: readonly Finding[]): Finding[] =>
  findings
    .map((finding, at) => ({ finding, at }))
    .sort((a, b) => kOrder.indexOf(a.finding.severity) - kOrder.indexOf(b.finding.severity) || a.at - b.at)
    .map(({ finding }) => finding);

/** The moment a finding is about: what the server says, else the beginning of the segment that its file is. */
export function momentOf(finding: Finding, timeline: Timeline | undefined): number | undefined {
  if (typeof finding.time_ns === 'number') return finding.time_ns;
  if (isOfLog(finding)) return undefined;
  const segment = /(?:^|\/)segments\/([^/]+)\/0*(\d+)\./.exec(finding.file ?? '');
  if (!segment || !timeline) return undefined;
  return timeline.segments.find((one) => one.stream === segment[1] && one.index === Number(segment[2]))?.start_ns;
}

export const severityText = (severity: Severity): MessageKey => `severity.${severity}`;
