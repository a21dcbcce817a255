// That what programs say in English has its Japanese: every sentence is read from the sources that say it.
import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { deedInJapanese, endInJapanese } from '@/i18n/log_words';
import { messages } from '@/i18n/messages';
import { SentencePatterns } from '@/i18n/sentence_patterns';
import { hasJapanese } from '@/i18n/server_words';
import { wayInJapanese } from '@/i18n/way_words';
import { kLogTypes } from '@/log/log_entry';
import { kValue, type Sentence, sentencesOf } from './cpp_sentences';

const root = process.env['KIROKU_SOURCE_DIR'] ?? '';
if (root === '') throw new Error('KIROKU_SOURCE_DIR names the checkout');

const kJapanese = /[\u3040-\u30ff\u4e00-\u9fff]/;
/** Told by libraries below, in words of their own: the page puts Japanese before them by the answer's status. */
const isOfOthers = ({ text }: Sentence) => text.replaceAll(kValue, '').trim() === '';
/** What breaks the protocol, which the page itself never does. */
const isOfProtocol = ({ text }: Sentence) =>
  /^('|an 'id' |a message |a pointer |the body must |the header |files can only be read|this address |the range |this is not HTTP|this server speaks)/.test(
    text,
  );

/** Where the viewer's server says something to the page. */
const kServer = ['viewer/api', 'viewer/http', 'viewer/people', 'viewer/programs', 'viewer/rooms', 'viewer/server'];

describe('Sentences in C++', () => {
  it('are read as they are put together', () => {
    const found = sentencesOf(root, kServer, 'Refusal', 1).map((one) => one.text);
    expect(found).toContain(`there is no case ${kValue}`);
    // Over several lines, and with a choice within.
    expect(found).toContain(`another comparison is being made by ${kValue}: wait until it is done`);
    expect(found.length).toBeGreaterThan(80);
  });
});

describe('What the server refuses', () => {
  it('is told in Japanese', () => {
    const said = [
      ...sentencesOf(root, ['viewer'], 'Refusal', 1),
      ...sentencesOf(root, kServer, 'refused', 1),
      ...sentencesOf(root, kServer, 'refuse', 1),
      ...sentencesOf(root, kServer, 'Response::error', 1),
    ];
    const lacking = said.filter((one) => !isOfOthers(one) && !hasJapanese(one.text) && !isOfProtocol(one));
    expect(lacking).toEqual([]);
  });
});

describe('What planning tells of cuts on the picture', () => {
  it('is told in Japanese', () => {
    const said = [
      ...sentencesOf(root, ['viewer/planning'], 'Error', 0).filter((one) => one.file.endsWith('cut_handles.cpp') || /\bline\b/.test(one.text)),
      ...sentencesOf(root, ['viewer/planning'], 'emplace_back', 0).filter((one) => /\bline\b/.test(one.text)),
    ];
    expect(said.length).toBeGreaterThanOrEqual(7);
    expect(said.filter((one) => !hasJapanese(one.text))).toEqual([]);
  });
});

describe('The appliance log', () => {
  const types = /kTypes\{(.*?)\};/s.exec(readFileSync(`${root}/archive/format/log_entry.cpp`, 'utf8'))?.[1] ?? '';
  const names = [...types.matchAll(/"([a-z-]+)"/g)].map((one) => one[1] as string);

  it('has a name in both languages for every kind of entry', () => {
    expect(names.length).toBeGreaterThan(10);
    expect([...kLogTypes].sort()).toEqual([...names].sort());
    for (const name of names) {
      for (const language of ['en', 'ja'] as const) expect(messages[language], name).toHaveProperty([`logType.${name}`]);
    }
  });
  it('has a name in both languages for everything an entry carries', () => {
    const source = readFileSync(`${root}/archive/format/log_entry.cpp`, 'utf8');
    const fields = new Set([...source.matchAll(/\.(?:text|digest|count|integer)\("([a-z_0-9]+)"/g)].map((one) => one[1] as string));
    for (const own of ['case', 'what', 'who', 'type', 'seq', 'utc', 'mono_ns']) fields.delete(own);
    expect(fields.size).toBeGreaterThan(8);
    for (const field of fields) {
      for (const language of ['en', 'ja'] as const) expect(messages[language], field).toHaveProperty([`logField.${field}`]);
    }
  });

  it('tells every deed in Japanese', () => {
    // (request, case, what), (request, case, what, question), (case, what, who, address), (case, what, who), (home, folder, what)
    const places: Record<string, (given: readonly string[]) => number> = {
      enter_access: (given) => (given.length === 4 ? 1 : 2),
      enter_access_once: () => 2,
      note_access: () => 1,
      log_access: () => 2,
      enter_and_ask: () => 2,
      // (request, what), (home, folder, purpose, what)
      enter_purpose: (given) => given.length - 1,
    };
    const said = Object.entries(places).flatMap(([name, which]) => sentencesOf(root, ['viewer', 'apps'], name, which));
    // Words that come from a variable: where they are given to it.
    const given = [
      ...sentencesOf(root, ['viewer/api/'], 'answer', 1).filter((one) => one.file.endsWith('playback_api.cpp')),
      ...sentencesOf(root, ['viewer/api/'], 'file', 2)
        .filter((one) => one.file.endsWith('comparison_api.cpp'))
        .map((one) => ({ ...one, text: one.text + kValue })),
      { file: 'viewer/kept/log_of_case.cpp', text: `compared with a plan, document sha256 ${kValue}` },
    ];
    expect(given.filter((one) => !isOfOthers(one)).length).toBeGreaterThanOrEqual(7);
    const kIndirect = [
      'comparison_api.cpp',
      'playback_api.cpp',
      'room_api.cpp',
      'viewer_context.cpp',
      'viewer_context.h',
      'home.cpp',
      'export_api.cpp',
      'standing_consents.cpp',
    ];
    const all = [...said, ...given];
    const unknown = all.filter(isOfOthers).filter((one) => !kIndirect.some((file) => one.file.endsWith(file)));
    expect(unknown, 'say here where these words come from').toEqual([]);
    const lacking = all.filter((one) => !isOfOthers(one) && !kJapanese.test(deedInJapanese(one.text) ?? ''));
    expect(lacking).toEqual([]);
  });
  it('tells why an invitation ended in Japanese', () => {
    const source = readFileSync(`${root}/viewer/api/viewer_context.cpp`, 'utf8');
    const reasons = [...source.matchAll(/case InvitationEnd::\w+:\s*return "([^"]+)"/g)].map((one) => one[1] as string);
    expect(reasons.length).toBeGreaterThan(5);
    for (const reason of reasons) expect(endInJapanese(reason), reason).toMatch(kJapanese);
  });
  it('names what a deed was about in words of the page', () => {
    expect(deedInJapanese('watched endoscope')).toMatch(kJapanese);
    expect(deedInJapanese('watched or-1/endoscope live')).toContain('or-1/');
    expect(deedInJapanese('adds user anna as surgeon')).toContain('anna');
  });
});

describe('The ways to the hospital’s procedures', () => {
  const ofWorklist = sentencesOf(root, ['recorder/procedure'], 'fail', 0).map(({ text }) => `the worklist ${kValue} at ${kValue} ${text}`);
  const ofListening = sentencesOf(root, ['recorder/vitals'], 'UsageError', 0)
    .map(({ text }) => text)
    .filter((text) => /^cannot (wait|use the certificate)/.test(text));
  it('are told in Japanese, with and without what a library adds', () => {
    expect(ofWorklist.length).toBeGreaterThan(3);
    expect(ofListening.length).toBeGreaterThan(1);
    const states = [
      ...ofWorklist,
      ...ofWorklist.filter((text) => !/has no|refused|any more/.test(text)).map((text) => `${text}: ${kValue}`),
      ...ofListening,
      'waits for messages at mllp://0.0.0.0:2576; 12 taken, 1 refused',
      'waits for messages at mllp://0.0.0.0:2576; 12 taken, 1 refused, 3 connections of strangers',
      'waits for messages at mllp://0.0.0.0:2576; 12 taken, 1 refused; messages before 2026-11-28T14:02Z are not known',
      'waits for messages at mllp://0.0.0.0:2576; 12 taken, 1 refused, 3 connections of strangers; messages before 2026-11-28T14:02Z are not known',
      'waits for messages at mllp://0.0.0.0:2576; 12 taken, 1 refused; messages that said too late that somebody left or is planned no more: 2',
      'HIS listed 7 steps at 2026-11-23T09:00:00Z',
      'is being asked for the first time',
      'nothing is chosen from the list of 2026-11-23T09:00:00Z, which is 60 min old: it is asked again',
      'does not wait for messages yet',
    ];
    for (const state of states) expect(wayInJapanese(state), state).toMatch(kJapanese);
    expect(wayInJapanese('the worklist HIS at 192.0.2.9:104 cannot be asked: Peer aborted')).toBe(
      '192.0.2.9:104 のワークリスト HIS に問い合わせできません（Peer aborted）',
    );
    expect(wayInJapanese('waits for messages at x; 1 taken, 0 refused; messages that said too late that somebody left or is planned no more: 2')).toBe(
      'x で待ち受け中（受理 1 件、拒否 0 件）。うち 2 件は、退室または予定の取り消しを遅れて伝えたものです',
    );
    expect(
      wayInJapanese('nothing is chosen from the list of 2026-11-23T09:00:00Z, which is 60 min old: the worklist HIS at 192.0.2.9:104 cannot be asked'),
    ).toBe('2026-11-23T09:00:00Z の一覧は 60 分前のものであるため、自動では選択しません。192.0.2.9:104 のワークリスト HIS に問い合わせできません');
  });
});

describe('Patterns of sentences', () => {
  const patterns = new SentencePatterns([
    ['there is no case {id}', '症例 {id} は存在しません'],
    ["{n} of {all} (50 %) '*'", '{all} 中 {n}'],
  ]);
  it('keep values where they belong', () => {
    expect(patterns.inJapanese('there is no case 2026')).toBe('症例 2026 は存在しません');
    expect(patterns.inJapanese("3 of 7 (50 %) '*'")).toBe('7 中 3');
  });
  it('know nothing of other sentences', () => {
    for (const other of ['there is no case', 'well, there is no case 2026', '']) expect(patterns.inJapanese(other)).toBeUndefined();
  });
});
