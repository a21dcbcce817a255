// How a way to the hospital's procedures is, in the page's language. The recorder's sentences are English (recorder/procedure, recorder/vitals/mllp_server.cpp);
// a test reads them from the sources. What a library adds behind a colon stays as it is.
import { language } from '@/i18n/i18n';
import { type SentencePair, SentencePatterns } from '@/i18n/sentence_patterns';

export const kWaySentences: readonly SentencePair[] = [
  ['{way}; messages that said too late that somebody left or is planned no more: {n}', '{way}。うち {n} 件は、退室または予定の取り消しを遅れて伝えたものです'],
  [
    'nothing is chosen from the list of {time}, which is {n} min old: it is asked again',
    '{time} の一覧は {n} 分前のものであるため、自動では選択しません。再度問い合わせ中です',
  ],
  ['nothing is chosen from the list of {time}, which is {n} min old: {way}', '{time} の一覧は {n} 分前のものであるため、自動では選択しません。{way}'],
  [
    "the worklist cannot be asked: DCMTK's data dictionary (dicom.dic) is not installed",
    'DCMTK のデータ辞書（dicom.dic）が導入されていないため、ワークリストに問い合わせできません',
  ],
  ['the worklist cannot be asked: {why}', 'ワークリストに問い合わせできません（{why}）'],
  ['the worklist {ae} at {place} cannot be asked: {why}', '{place} のワークリスト {ae} に問い合わせできません（{why}）'],
  ['the worklist {ae} at {place} cannot be asked', '{place} のワークリスト {ae} に問い合わせできません'],
  ['the worklist {ae} at {place} has no modality worklist', '{place} の {ae} はモダリティワークリストを提供していません'],
  ['the worklist {ae} at {place} did not answer to the end: {why}', '{place} のワークリスト {ae} の応答が途中で切れました（{why}）'],
  ['the worklist {ae} at {place} did not answer to the end', '{place} のワークリスト {ae} の応答が途中で切れました'],
  ['the worklist {ae} at {place} refused the question with status {status}', '{place} のワークリスト {ae} が問い合わせを拒否しました（状態 {status}）'],
  ['the worklist {ae} at {place} is not asked any more', '{place} のワークリスト {ae} への問い合わせを終了しました'],
  ['is being asked for the first time', '最初の問い合わせ中です'],
  [
    '{ae} listed {n} steps at {time}; {others} steps of other stations or modalities were listed, too, and cannot be chosen',
    '{ae} は {time} に {n} 件を返しました。別の装置またはモダリティの {others} 件も返されましたが、選択できません',
  ],
  ['{ae} listed {n} steps at {time}', '{ae} は {time} に {n} 件を返しました'],
  ['does not wait for messages yet', 'まだメッセージを待ち受けていません'],
  [
    'waits for messages at {place}; {taken} taken, {refused} refused, {strangers} connections of strangers; messages before {since} are not known',
    '{place} で待ち受け中（受理 {taken} 件、拒否 {refused} 件、許可のない接続 {strangers} 件）。{since} より前のメッセージは不明です',
  ],
  [
    'waits for messages at {place}; {taken} taken, {refused} refused; messages before {since} are not known',
    '{place} で待ち受け中（受理 {taken} 件、拒否 {refused} 件）。{since} より前のメッセージは不明です',
  ],
  [
    'waits for messages at {place}; {taken} taken, {refused} refused, {strangers} connections of strangers',
    '{place} で待ち受け中（受理 {taken} 件、拒否 {refused} 件、許可のない接続 {strangers} 件）',
  ],
  ['waits for messages at {place}; {taken} taken, {refused} refused', '{place} で待ち受け中（受理 {taken} 件、拒否 {refused} 件）'],
  ['cannot wait for monitors at {place}: {why}; {advice}', '{place} で待ち受けできません（{why}）。アドレスとポートを確認してください'],
  [
    "cannot use the certificate '{file}' or its key for monitors: {why}; {advice}",
    '証明書「{file}」またはその鍵を使えません（{why}）。どちらも PEM ファイルで、鍵はパスフレーズなしでなければなりません',
  ],
];

const kPatterns = new SentencePatterns(kWaySentences);

/** Whatever other sentence the recorder says comes behind words that tell what it is. */
export function wayInOwnWords(state: string): string {
  if (language.value === 'en') return state;
  return wayInJapanese(state) ?? `装置からの報告：${state}`;
}

export const wayInJapanese = (state: string): string | undefined =>
  kPatterns.inJapanese(state, (name, value) => (name === 'way' ? (wayInJapanese(value) ?? value) : value));
