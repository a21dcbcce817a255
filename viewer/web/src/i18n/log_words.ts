// What an entry of the appliance log says, in the page's language: deeds (`what` of an access) and whatever else an entry carries. The entry itself stays as
// it was signed; in Japanese its own words stand beside. Tests read the sources and fail where a deed or a field has no Japanese.
import { language, word } from '@/i18n/i18n';
import { type SentencePair, SentencePatterns } from '@/i18n/sentence_patterns';

export const kDeeds: readonly SentencePair[] = [
  ['watched vital signs', 'バイタルサインを閲覧'],
  ['watched pointing', '指示の記録を閲覧'],
  ['watched the plan of comparison {name}', '比較「{name}」の計画映像を閲覧'],
  ["watched the plan's radiographs of comparison {name}", '比較「{name}」の計画透視像を閲覧'],
  ['watched {room}/{stream} live', '{room}/{stream} のライブ映像を閲覧'],
  ['watched {stream}', '{stream}を閲覧'],
  ['read marks', 'マークを閲覧'],
  ['read comparisons', '比較の一覧を閲覧'],
  ['read comparison {name}', '比較「{name}」を閲覧'],
  ['matched a plan by hand', '計画の手順を手作業で対応付け'],
  ['picked points on pictures of a plan', '計画の画像で点を選択'],
  ['asked for a comparison with a plan, {name}', '計画との比較「{name}」を依頼'],
  ['compared with a plan, document sha256 {hash}', '計画と比較（文書の sha256 {hash}）'],
  ['opened to compare it with a plan', '計画と比較するために開封'],
  ['wrote a comparison with a plan', '計画との比較を書き出し'],
  ['wrote the steps that were found', '見つかった手順を書き出し'],
  ['exported {stream}', '{stream}を書き出し'],
  ['read the consents', '同意の記載を閲覧'],
  ['took an excerpt, sealed as it is', '封印されたまま抜粋を取得'],
  ['excerpt for a new reader', '新しい受信者のための抜粋を作成'],
  ['made a receipt', '控えを作成'],
  ['found the legal hold of {count} of the case lifted in the store, {key}, and set it again', '保存先で法的保全が解除されていたため再設定（{count}、{key}）'],
  [
    'found the legal hold of {count} of the case lifted in the store, {key}, and could not set it again everywhere',
    '保存先で法的保全が解除されており、すべては再設定できなかった（{count}、{key}）',
  ],
  ['found the lock of {count} of the case lifted in the store, {key}, and set it again', '保存先でロックが解除されていたため再設定（{count}、{key}）'],
  [
    'found the lock of {count} of the case lifted in the store, {key}, and could not set it again everywhere',
    '保存先でロックが解除されており、すべては再設定できなかった（{count}、{key}）',
  ],
  ['read the light of a display in the pictures', '映像中の表示コードを読取り'],
  ['read the codes of a display in the pictures and the sound', '映像と音声中の表示コードを読取り'],
  ['opened to calibrate a lens', 'レンズの校正のために開封'],
  ['made a verification report', '検証報告書を作成'],
  ['verified with an identity', '識別鍵を用いて検証'],
  ['made a certificate of training for {name}', '{name} の訓練証明を作成'],
  ['found no signature of this device over entries {from} to {to}', 'この装置の署名がない項目 {from}～{to} を確認'],
  [
    'set aside what stood from entry {entry} on, which this device did not sign, sha256 {hash}',
    '項目 {entry} 以降の、この装置が署名していない内容を別に保管（sha256 {hash}）',
  ],
  [
    'set aside {count} of the {all} bytes that stood from entry {entry} on, which this device did not sign, sha256 {hash}',
    '項目 {entry} 以降の、この装置が署名していない内容 {all} バイトのうち {count} バイトを別に保管（sha256 {hash}）',
  ],
  [
    'set aside what stood in lines from entry {entry} on that this device had signed, and that are no entries any more, sha256 {hash}',
    '項目 {entry} 以降で、この装置が署名したのち項目でなくなった行の内容を別に保管（sha256 {hash}）',
  ],
  [
    'found beside the log what was set aside from entry {entry} on, of which no entry told, sha256 {hash}',
    '項目 {entry} 以降を別に保管したファイルで、どの項目にも記載のないものを確認（sha256 {hash}）',
  ],
  ['unlocked recordings with an identity', '識別鍵で記録を解錠'],
  ["unlocked recordings with the server's identity", 'サーバの識別鍵で記録を解錠'],
  ['adds user {name} as {role}', '利用者 {name} を{role}として追加'],
  ['changes user {name} as {role}', '利用者 {name} を{role}に変更'],
  ['changes user {name} from {role} to {role2}', '利用者 {name} の役割を{role}から{role2}に変更'],
  ['resets the password of user {name}', '利用者 {name} のパスワードを再発行'],
  ['chose a new password', '新しいパスワードを設定'],
  ['listed patients, procedures and staff of cases', '症例の患者、術式、スタッフを一覧'],
  ['searched for cases of a patient', '患者で症例を検索'],
  ['searched for cases of a procedure', '術式で症例を検索'],
  ['searched for cases of a patient and a procedure', '患者と術式で症例を検索'],
  ['read patient, procedure and staff', '患者、術式、スタッフを閲覧'],
  ['looked at the planned procedures of {room}', '{room} の予定手術を閲覧'],
  ['asked to start recording in {room}', '{room} の記録開始を指示'],
  ['asked to stop recording in {room}', '{room} の記録終了を指示'],
  ['marked a moment in {room}', '{room} でマークを追加'],
  ['changed how pictures of {room} are archived', '{room} の映像の保存形式を変更'],
  ['gave patient and procedure of {room}', '{room} の患者と術式を入力'],
  ['watched vital signs of {room} live', '{room} のバイタルサインをライブ閲覧'],
  ['removes user {name}', '利用者 {name} を削除'],
  ['enrols appliance {name} by request {fingerprint}', '装置 {name} を登録（申請 {fingerprint}）'],
  ['revokes appliance {name}', '装置 {name} の登録を取り消し'],
  ['opened plan {plan} with its volume', '計画 {plan} を CT とともに開封'],
  ['opened {stream} to fit a breathing lung', '呼吸する肺をあてはめるため {stream} を開封'],
  ['opened lung {file} with its CT and {n} radiographs of its {stream}', '肺モデル {file} を CT およびこの症例の {stream} の X 線画像 {n} 枚とともに開封'],
  ['opened lung {file} with its CT and {n} radiographs', '肺モデル {file} を CT および X 線画像 {n} 枚とともに開封'],
  ['mends {file} from {copy}', '保管庫の {file} を {copy} から修復'],
  ['mended {file} from {copy}, sha256 {hash}, version {id}', '保管庫の {file} を {copy} から修復済み（sha256 {hash}、版 {id}）'],
  ['could not mend {file}: {reason}', '保管庫の {file} を修復できず：{reason}'],
  ['invites guest {guest} to {room} until {time} (invitation {id})', 'ゲスト {guest} を {room} に {time} まで招待（招待 {id}）'],
  ['revokes invitation {id} of guest {guest} to {room}', 'ゲスト {guest} の {room} への招待 {id} を取り消し'],
  ['joined {room} by invitation {id} of {name}', '{name} の招待 {id} により {room} に参加'],
  ['watches {room} again by invitation {id}', '招待 {id} により {room} の閲覧を再開'],
  ['watches {room} no more, invitation {id} lasts', '{room} の閲覧を中断（招待 {id} は有効）'],
  ['invitation {id} of guest {guest} to {room} ended: {why}', 'ゲスト {guest} の {room} への招待 {id} が終了：{why}'],
];

/** Why an invitation ended (viewer/api/viewer_context.cpp). */
export const kEnds: readonly SentencePair[] = [
  ['it was revoked', '取り消し'],
  ['its time is over', '時間切れ'],
  ['the case is over', '症例の終了'],
  ['the guest left', 'ゲストの退出'],
  ['the inviter was removed or changed', '招待者の削除または変更'],
  ['the viewer was stopped', 'ビューアの停止'],
];

const kPatterns = new SentencePatterns(kDeeds);
const kEndPatterns = new SentencePatterns(kEnds);

function valueInJapanese(name: string, value: string): string {
  if (name === 'stream') return word('stream', value);
  if (name === 'role') return word('role', value);
  if (name === 'why') return kEndPatterns.inJapanese(value) ?? value;
  return value;
}

export const deedInJapanese = (deed: string): string | undefined => kPatterns.inJapanese(deed, valueInJapanese);
export const endInJapanese = (why: string): string | undefined => kEndPatterns.inJapanese(why);

/** A deed as it is shown. */
export function deedInWords(deed: string): string {
  return language.value === 'en' ? deed : (deedInJapanese(deed) ?? deed);
}

/** A field that an entry carries: "size 412". */
export const fieldInWords = (field: string, value: string): string => `${word('logField', field)} ${value}`;
