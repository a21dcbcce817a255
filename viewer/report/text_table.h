// The dictionary's table: key, English, Japanese (texts.h).
#pragma once

#include <array>
#include <string_view>

namespace kiroku::report {

struct Text {
  std::string_view key, english, japanese;
};

/// "{0}", "{1}" … stand for values. Both languages use the same ones.
inline constexpr auto kTexts = std::to_array<Text>({
    // -- titles and frames of the documents
    {"report.title", "Verification report", "検証報告書"},
    {"report.of", "Recording of an operation, case {0}", "手術記録　症例番号 {0}"},
    {"report.of-excerpt", "Excerpt from the recording of an operation, case {0}",
     "手術記録の抜粋　症例番号 {0}"},
    {"report.foot", "{0} · made {1} by {2}", "{0}・{1} 作成・{2}"},
    {"receipt.title", "Receipt of a recording", "手術記録の控え"},
    {"page", "{0} of {1}", "{0} / {1}"},
    {"verdict-of-subject", "Verdict: {0}", "判定：{0}"},
    // -- verdicts
    {"verdict.intact", "INTACT", "改変なし"},
    {"verdict.intact.sentence",
     "Everything in this record is as it was recorded: nothing was changed, nothing was removed, nothing was "
     "added.",
     "この記録は、記録されたときのままです。変更・削除・追加はありません。"},
    {"verdict.intact.sentence.beside",
     "Everything in this record is as it was recorded: nothing was changed, nothing was removed.",
     "この記録は、記録されたときのままです。変更・削除はありません。"},
    {"beside.one",
     "Beside it lies {0} file that nobody recorded, of a kind that operating systems leave behind. It is no "
     "part "
     "of the record, and is not counted.",
     "ほかに、誰も記録していないファイルが {0} "
     "個あります（オペレーティングシステムが残す種類のもの）。記録の一"
     "部ではなく、数に入れていません。"},
    {"beside.many",
     "Beside it lie {0} files that nobody recorded, of a kind that operating systems leave behind. They are "
     "no "
     "part of the record, and are not counted.",
     "ほかに、誰も記録していないファイルが {0} "
     "個あります（オペレーティングシステムが残す種類のもの）。記録の一"
     "部ではなく、数に入れていません。"},
    {"verdict.gaps", "INTACT, WITH STATED GAPS", "改変なし（欠落の記載あり）"},
    {"verdict.gaps.sentence",
     "What is in this record is as it was recorded. Some of what happened is not in it, or is not there any "
     "more; the signed record itself says so, and this report lists it.",
     "この記録にあるものは、記録されたときのままです。一部は記録されなかったか、後に消去されていますが、その"
     "旨は署"
     "名された記録自体に記されており、本書に一覧を示します。"},
    {"verdict.gaps.sentence.elsewhere",
     "What is in this record is as it was recorded. Some of what happened is not in it, or is not there any "
     "more; the signed record itself says so, and the verification report lists it.",
     "この記録にあるものは、記録されたときのままです。一部は記録されなかったか、後に消去されていますが、その"
     "旨は署名された記録自体に記されており、検証報告書に一覧を示します。"},
    {"verdict.excerpt.gaps",
     "Some of its stretch of time is not in it, or is not there any more: the lines of the excerpt say so.",
     "この時間の一部は記録されなかったか、後に消去されています（抜粋の行に記載）。"},
    {"verdict.excerpt", "INTACT EXCERPT", "抜粋として改変なし"},
    {"verdict.excerpt.sentence",
     "This is a part of a recording, not the recording. What it holds is as it was recorded. What it leaves "
     "out was not here to be checked.",
     "これは記録の一部であり、記録の全体ではありません。ここにあるものは記録されたときのままです。含まれない"
     "部分は検査の対象にありません。"},
    {"verdict.unproven", "COULD NOT BE PROVED", "証明できない"},
    {"verdict.unproven.sentence",
     "Nothing in this record contradicts itself, but something that would prove it was not given or is not "
     "there. It "
     "is neither confirmed nor refuted.",
     "この記録に矛盾は見つかりませんが、証明に必要なものが与えられていないか、存在しません。確認も否定もでき"
     "ません。"},
    {"verdict.newer.sentence",
     "This record is of a later version of the format than this program knows. What its entries say, and its "
     "files, was not checked: use a newer version of the program. It is neither confirmed nor refuted.",
     "この記録は、このプログラムの知る版より新しい形式のものです。項目の内容とファイルは検査していません。新"
     "し"
     "い版のプログラムを用いてください。確認も否定もできません。"},
    {"verdict.incomplete", "NOT FINISHED", "未完了"},
    {"verdict.incomplete.sentence",
     "This record was not brought to its end: it is still being recorded, or recording was cut off. What "
     "there is of it was checked. What nobody has signed of it, the findings say.",
     "この記録は完結していません。記録中であるか、途中で断たれています。存在する部分については検査しました。"
     "誰も署"
     "名していない部分は所見に示します。"},
    {"verdict.tampered", "DOES NOT HOLD (TAMPERED)", "成立しない（改変あり）"},
    {"verdict.tampered.sentence",
     "This record is not as it was recorded: something in it was changed, removed or added, or has been "
     "damaged. The "
     "findings say what and where. A check cannot tell intent from a fault.",
     "この記録は、記録されたときのままではありません。何かが変更・削除・追加されたか、破損しています。内容と"
     "箇所は"
     "「所見」に示します。故意か故障かは、検査では判別できません。"},
    // -- time, as the statement tells it
    {"time.external", "Authorities outside the recorder time-stamped it, from {0} to {1}.",
     "記録装置の外部の時刻認証局が {0} から {1} までタイムスタンプを付与しました。"},
    {"time.brackets-below", "Between which times each part was written, the brackets below say.",
     "各部分が記録された時刻の範囲は、下の表に示します。"},
    {"time.brackets-elsewhere", "Between which times each part was written, the verification report says.",
     "各部分が記録された時刻の範囲は、検証報告書に示します。"},
    {"time.remark.there-by-then", "When it was recorded, and for how long, rests on the recorder's word.",
     "いつ、どれだけの時間記録されたかは、記録装置のみに依拠します。"},
    {"time.remark.first-late",
     "By the case clock recording began {0} before the first time stamp: that it began no earlier is not "
     "proved.",
     "症例時計によれば、記録は最初のタイムスタンプの {0} "
     "前に始まりました。それ以前でないことは記録装置のみに依拠し"
     "ます。"},
    {"time.remark.entered-late",
     "By the case clock some of it ended {0} before the time stamp in front of it: its age is not proved.",
     "症例時計によれば、タイムスタンプの後に記入された記録の一部は、その {0} "
     "前に終わっています。より古くないことは記録装置のみに依拠します。"},
    {"time.remark.end-late",
     "That recording ended when it says rests on the recorder's word: the time stamp over its end is later.",
     "終了に対するタイムスタンプは終了時刻より遅く、そこで終わったことは記録装置のみに依拠します。"},
    {"time.remark.clock-differs",
     "By the time stamps the recorder's clock was wrong, and so are all times by it.",
     "タイムスタンプによれば記録装置の時計は誤っており、この時計による時刻もすべて誤りです。"},
    {"time.remark.length-differs",
     "How long it lasted, the case clock alone says: from opening to closing the recorder's clock went on by "
     "another time.",
     "開始から終了までに記録装置の時計が進んだ時間は症例時計と異なり、長さを示すのは症例時計のみです。"},
    {"time.external-until",
     "When it existed is proved by time-stamping authorities outside the recorder: no later than {0}.",
     "存在した時刻は、記録装置の外部の時刻認証局により証明されています（{0} 以前）。"},
    {"time.external-in-part",
     "Authorities outside the recorder time-stamped it as far as entry {0} of its ledger. When what follows "
     "was "
     "written rests on the recorder's word alone.",
     "記録装置の外部の時刻認証局がタイムスタンプを付与したのは台帳の項目 {0} "
     "までです。それ以降が書かれた時刻は、記録装置のみに依拠します。"},
    {"time.self-issued",
     "Its times were stated by the recorder's own time-stamping authority alone: no clock outside stands "
     "behind them.",
     "時刻は記録装置に内蔵された時刻認証局のみによるもので、外部の時計による裏付けはありません。"},
    {"time.none", "No time stamp could be checked: when it existed is not proved.",
     "検査できたタイムスタンプがなく、存在した時刻は証明されていません。"},
    {"time.none.record",
     "None of its own time stamps could be relied on: since when it existed, its evidence record alone says.",
     "症例自体のタイムスタンプには依拠できず、いつから存在したかは証拠記録のみが示します。"},
    {"time.other-entries",
     "No time stamp that could be checked is over the entries that are here: when these existed is not "
     "proved.",
     "検査できたタイムスタンプに、ここにある項目を対象とするものはなく、存在した時刻は証明されていません。"},
    {"time.ended",
     "By the policy that was given, an algorithm of its time stamps counts no more: when it existed is not "
     "proved.",
     "与えられた方針では、タイムスタンプのアルゴリズムがもう有効でないため、存在した時刻は証明されていません"
     "。"},
    {"scope.remark-unopened",
     "The pictures themselves were not opened; that takes a key and is not needed for the above.",
     "映像そのものは開いていません。開くには鍵が必要ですが、上記の判定には不要です。"},
    {"scope.remark-unopened-of", "The pictures of {0} were not opened. That is not needed for the above.",
     "{0} の映像は開いていません。上記の判定には不要です。"},
    {"signed-late.entries", "Nobody had signed the entries {0} to {1} until recording was found cut off.",
     "項目 {0} から {1} までは、記録の中断が見つかるまで署名されていませんでした。"},
    {"signed-late.entries.excerpt",
     "The excerpt shows no signature over the entries {0} to {1} from before recording was found cut off.",
     "この抜粋は、記録の中断が見つかる前の、項目 {0} から {1} までの署名を示していません。"},
    {"signed-late.more", "The same holds of {0} more stretches of entries.",
     "ほかに {0} か所の項目についても同様です。"},
    {"signed-late.found", "Until then no entry named {0}.", "それまで{0}を記載した項目はありませんでした。"},
    {"signed-late.who",
     "Whoever could write to the disk meanwhile could have made them, and the files that they name.",
     "その間にディスクに書き込めた者は、これらとその記載するファイルを作ることができました。"},
    // -- headings
    {"heading.answers", "What was checked", "検査した事項"},
    {"heading.case", "The case", "症例"},
    {"heading.chain", "How the proof holds together", "証明のつながり"},
    {"heading.streams", "What was recorded", "記録の内容"},
    {"heading.gaps", "Gaps", "欠落"},
    {"heading.time", "Proof of time", "時刻の証明"},
    {"heading.brackets", "Brackets", "時刻の範囲"},
    {"heading.tokens", "Time stamps", "タイムスタンプ"},
    {"heading.clocks", "Clocks", "時計"},
    {"heading.evidence", "Evidence record", "証拠記録"},
    {"heading.witnesses", "Witnesses of the log", "装置ログの証人"},
    {"heading.consent", "Consent to the use of the case", "症例の利用への同意"},
    {"heading.findings", "Findings", "所見"},
    {"heading.device", "Device key", "装置の鍵"},
    {"heading.hashes", "Hashes", "ハッシュ値"},
    {"heading.repeat", "Repeating this check", "検査の再現"},
    {"heading.about", "About this report", "本書について"},
    {"heading.words", "Words used", "用語"},
    // -- questions, and their answers
    {"answer.yes", "Yes", "はい"},
    {"answer.with-gaps", "Yes, with stated gaps", "はい（記載された欠落あり）"},
    {"answer.in-part", "In part", "一部のみ"},
    {"answer.inside-only", "Only from inside", "内部のみ"},
    {"answer.unknown", "Could not be checked", "確認できない"},
    {"answer.unfinished", "Not finished", "未完了"},
    {"answer.not-asked", "Not checked", "未検査"},
    {"answer.no", "No", "いいえ"},
    {"check.ledger",
     "Is the list of everything recorded (the ledger) unchanged, and signed by the device it names?",
     "記録の一覧（台帳）は変更されておらず、記載の装置により署名されているか"},
    {"check.ledger.yes", "{0} and {1} agree, each signature is that of the key in the ledger.",
     "{0}と{1}は一致し、署名はいずれも台帳に記載の鍵によるものです。"},
    {"check.ledger.in-part",
     "{0} and {1} agree, each signature is that of the key in the ledger. Nobody signed what follows entry "
     "{2}: anybody can have written it.",
     "{0}と{1}が一致し、各署名は台帳に記載の鍵によるものです。項目 {2} "
     "より後は署名されておらず、誰でも書くことができます。"},
    {"check.unsigned", "Nobody signed the ledger: anybody can have written it, and all that it lists.",
     "台帳は署名されていません。台帳とその記載内容は、誰でも書くことができます。"},
    {"check.newer", "This rests on entries of a later version of the format, which were not checked.",
     "これは、より新しい版の形式の項目に拠るものであり、検査していません。"},
    {"check.ledger.changed", "The lines of the ledger do not hold, so nothing is said about this.",
     "台帳の行が成立しないため、これについては何も述べません。"},
    {"check.excerpt.unread", "The lines of this excerpt do not hold, so nothing is said about this.",
     "この抜粋の台帳の行が成立しないため、これについては何も述べません。"},
    {"check.files", "Is every file there, and exactly as it was when it was listed?",
     "すべてのファイルが存在し、一覧に記載されたときのままか"},
    {"check.files.yes",
     "The ledger names {0}, and each has the hash that it states. Beside these are the ledger, its "
     "checkpoints, "
     "the device's public key and certificates of authorities, {1} in all. What else is there the findings "
     "name.",
     "台帳に記載の{0}"
     "は、すべて記載どおりのハッシュ値です。ほかに台帳、そのチェックポイント、装置の公開鍵、"
     "認証局の証明書があります（合計 {1}）。それ以外のものは所見に記します。"},
    {"check.files.unasked",
     "Every file that could be looked for is there. But entries cannot be read, or name files that they may "
     "not: "
     "what they list was not looked for. The findings say which.",
     "探すことのできたファイルはすべてあります。ただし、読み取れない項目または名称の誤った項目があり、それら"
     "が記すもの"
     "は確認していません（所見を参照）。"},
    {"check.at-least", "at least {0}", "少なくとも {0}"},
    {"check.all", "{0}", "{0}"},
    {"check.files.excerpt", "Is every file of the excerpt there, and exactly as it was when it was listed?",
     "抜粋のすべてのファイルが存在し、一覧に記載されたときのままか"},
    {"check.files.excerpt.yes",
     "Its lines name {0} that are here, and each has the hash that they state: {2}. Beside these are the "
     "lines, "
     "the excerpt's own documents, the checkpoints, the device's public key and certificates of authorities, "
     "{1} in all. What else is there the findings name. Files of "
     "the case outside the excerpt were not here to be checked.",
     "抜粋の行に記載されここにある{0}は、すべて記載どおりのハッシュ値です（{2}"
     "）。ほかに行、抜粋自体の文書、チェックポイント、"
     "装置の公開鍵、認証局の証明書があります（合計 "
     "{1}）。それ以外のものは所見に記します。症例のうち抜粋に含まれないファイルは検査していません。"},
    {"check.files.rekeyed",
     "Its lines name {0} that are here. Of these {1} are as they were recorded, and each has the hash that "
     "the lines state. {2} were sealed anew for another reader, and have other hashes: of each of these the "
     "original header, kept beside, and the payload together have the hash that the lines state. {3} Here "
     "are: {4}. Beside these are the lines, the excerpt's own documents, the checkpoints, the device's "
     "public key and certificates of authorities, {5} in all. What else is there the findings name. Files of "
     "the case outside the excerpt were not here to be checked.",
     "抜粋の行に記載されここにあるのは{0}です。そのうち {1} "
     "個は記録されたときのままで、いずれも記載どおりのハッシュ値です。{2} "
     "個は別の読み手のために封緘し直されており、ファイル自体のハッシュ値は記載と異なります。これらについては"
     "、傍らに保存された元のヘッダーと本体を合わせたものが、記載どおりのハッシュ値です。{3}（{4}"
     "）。ほかに行、抜粋自体の文書、チェックポイント、装置の公開鍵、認証局の証明書があります（合計 "
     "{5}）。それ以外のものは所見に記します。症例のうち抜粋に含まれないファイルは検査していません。"},
    {"check.files.rekeyed.same-key", "The new header of each yields the same key as the original one.",
     "新しいヘッダーの鍵は、いずれも元のヘッダーの鍵と同じです。"},
    {"check.files.rekeyed.some",
     "The new header of {0} was found to yield the same key as the original one; of the others nobody saw "
     "it.",
     "新しいヘッダーの鍵が元の鍵と同じことを確認したのは {0} 個で、それ以外は確認していません。"},
    {"check.files.rekeyed.not-opened",
     "Whether the new headers yield the same keys as the original ones was not looked at: that takes the "
     "reader's key.",
     "新しいヘッダーの鍵が元の鍵と同じかどうかは確認していません（読み手の鍵が必要です）。"},
    {"check.streams", "Was it recorded without a break from beginning to end?",
     "始めから終わりまで途切れなく記録されたか"},
    {"check.streams.yes",
     "Segments follow each other without hole or overlap; the recorder dropped no frame that reached it.",
     "区間は隙間も重なりもなく連続し、記録装置に届いたフレームの欠落はありません。"},
    {"check.streams.nothing", "Nothing was recorded: no stream of pictures or vital signs holds anything.",
     "何も記録されていません。映像やバイタルサインの系統に、区間が一つもありません。"},
    {"check.streams.open",
     "The case was not closed, or nobody signed its end. How its streams end, and what followed, is not "
     "known.",
     "症例が閉じられていないか、終了に署名がありません。各系統がどのように終わったか、その後に何があったかは"
     "不明です。"},
    {"check.streams.in-part",
     "No hole was found between segments. But a stream is shorter than the case, holds far fewer frames than "
     "is usual in it, or no sample for more than a minute: the findings say which.",
     "区間の間に空白は見つかりませんでした。ただし、症例より短い系統、フレームが通常より著しく少ない系統、ま"
     "たは "
     "1 分を超えて値のない系統があります（所見を参照）。"},
    {"check.streams.in-part-with-gaps",
     "Every hole between segments is a stated gap. But a stream is shorter than the case, holds far fewer "
     "frames than is usual in it, or no sample for more than a minute: the findings say which.",
     "区間の間の空白はすべて記載されています。ただし、症例より短い系統、フレームが通常より著しく少ない系統、"
     "また"
     "は 1 分を超えて値のない系統があります（所見を参照）。"},
    {"check.streams.ends",
     "{0} What it recorded as it came begins at most {1} s after the case and ends at most {2} s before the "
     "case was closed. Silences of a camera of up to 5 s are no holes, and no silence of a monitor is.",
     "{0}到着時に記録された系統は、症例の開始から {1} 秒以内に始まり、症例が閉じられる {2} "
     "秒前以降まで続きます。カメラの 5 秒以内の途絶と、モニターの途絶は、空白とは見なされません。"},
    {"check.streams.excerpt", "Does the excerpt hold its streams without a break in its stretch of time?",
     "抜粋の時間内で、選ばれた系統は途切れなく含まれているか"},
    {"check.streams.excerpt.yes",
     "From {0} to {1} of the case the selected streams have no hole that nobody stated. About the time "
     "before "
     "and after, this does not say anything.",
     "症例時刻 {0} から {1} まで、選ばれた系統に記載のない空白はありません。その前後の時間については何も述べ"
     "ません。"},
    {"check.end", "Was the recording brought to its end?", "記録は完結しているか"},
    {"check.end.yes", "The last entry closes the case, and a signed checkpoint covers it.",
     "症例は閉じられ、署名付きチェックポイントで覆われています。"},
    {"check.end.excerpt", "This is an excerpt: the end of the case is not part of it.",
     "抜粋のため、症例の終わりは含まれていません。"},
    {"check.end.excerpt.closed",
     "This is an excerpt. Its lines show that the case was closed; whether all before that was recorded is "
     "not told by it.",
     "抜粋です。症例が終了したことは項目が示しますが、それまでがすべて記録されたかは分かりません。"},
    {"check.device", "Was it made by a device that whoever ordered this check trusts?",
     "検査依頼者が信頼する装置で作られたか"},
    {"check.device.yes", "The key of {0} is among the trusted keys that were given.",
     "{0} の鍵は、与えられた信頼できる鍵に含まれています。"},
    {"check.time", "Does somebody outside prove when it existed?",
     "存在した時刻は外部の者により証明されているか"},
    {"check.time.yes", "{0} by authorities under trusted roots hold.",
     "信頼されたルートの時刻認証局による{0}が成立しています。"},
    {"check.time.in-part",
     "As far as entry {0} of the ledger; of what follows the recorder alone says when it was written.",
     "台帳の項目 {0} まで。それ以降が書かれた時刻は、記録装置のみが述べています。"},
    {"check.time.inside", "{0} of the recorder's own authority hold; they prove order, not time.",
     "装置内蔵の認証局による{0}が成立していますが、証明するのは順序であり時刻ではありません。"},
    {"check.log", "Does the device's own log know this case, and the same of it?",
     "装置のログは、この症例を同じ内容で記録しているか"},
    {"check.log.yes",
     "The appliance log that was given knows its beginning, its checkpoints and its end as they are here.",
     "与えられた装置ログにある開始・チェックポイント・終了は、ここにあるものと一致します。"},
    {"check.log.in-part",
     "The appliance log that was given knows the case as it is here up to entry {0}. It knows no end of it "
     "that is signed: it may be a copy from before.",
     "与えられた装置ログは、この症例を項目 {0} "
     "まで、ここにあるとおりに記録しています。署名された終了は装置ログにありません（以前の写しである可能性が"
     "あります）。"},
    {"check.log.opening",
     "The appliance log that was given knows that the case was opened, and nothing of what followed: it may "
     "be "
     "a copy from before.",
     "与えられた装置ログには、この症例の開始のみがあります。その後については何も述べていません"
     "（以前の写しである可能性があります）。"},
    {"check.log.unsigned",
     "What the appliance log that was given says of the case was not signed when it was written: anybody can "
     "have added it.",
     "与えられた装置ログのこの症例に関する記述は、書かれた時点で署名されていません。"
     "誰でも書き加えることができます。"},
    {"check.log.not-compared", "The appliance log that was given could not be compared with the case.",
     "与えられた装置ログと症例を比較できませんでした。"},
    {"check.log.proof",
     "A proof from the appliance log shows that the entries up to {0} are those of the case as it ended.",
     "装置ログからの証明により、項目 {0} までが、終了した症例のものであることが示されています。"},
    {"check.log.excerpt.rest", "Whether the whole case still exists cannot be told from an excerpt.",
     "症例の全体が現存するかどうかは抜粋からは判りません。"},
    {"check.log.excerpt.yes",
     "The appliance log that was given knows the case, and the part of its ledger that is here. Whether the "
     "whole case still exists cannot be told from an excerpt.",
     "与えられた装置ログは、この症例と、ここにある台帳の部分を同じ内容で記録しています。症例の全体が現存する"
     "かどうかは抜粋からは判りません。"},
    {"check.log.excerpt.in-part",
     "The appliance log that was given knows the case, and the part of its ledger that is here up to entry "
     "{0}. It says nothing of entries {1} to {2}: a proof of the case's end, made on the recorder, does. "
     "Whether the whole case still exists cannot be told from an excerpt.",
     "与えられた装置ログは、この症例と、ここにある台帳の部分を項目 {0} まで同じ内容で記録しています。"
     "項目 {1} ～ {2} については何も述べていません"
     "（記録装置で作成する、症例の終了の証明があれば判ります）。"
     "症例の全体が現存するかどうかは抜粋からは判りません。"},
    {"check.log.excerpt.opening",
     "The appliance log that was given knows that the case was opened. It says nothing of the part of its "
     "ledger that is here, entries {0} to {1}: a proof of the case's end, made on the recorder, does. "
     "Whether the whole case still exists cannot be told from an excerpt.",
     "与えられた装置ログには、この症例の開始があります。"
     "ここにある台帳の部分（項目 {0} ～ {1}）については何も述べていません"
     "（記録装置で作成する、症例の終了の証明があれば判ります）。"
     "症例の全体が現存するかどうかは抜粋からは判りません。"},
    {"check.log.not-asked",
     "No appliance log was given. Without it nobody sees that a whole case, or its end, was removed.",
     "装置ログが与えられていません。これがないと、症例全体または末尾の削除は判りません。"},
    {"check.contents", "Do the sealed pictures and vital signs open, and show what the list says?",
     "封緘された映像とバイタルサインは開け、一覧のとおりの内容か"},
    {"check.contents.yes",
     "{0}: each was decrypted and decoded to as many frames as the ledger states, one film from the stated "
     "time "
     "stamp on; vital signs are of the stated time. Whether there is sound was not asked.",
     "{0}：いずれも復号し、台帳に記載の時刻印から、記載のフレーム数どおりに一つの映像として再生できました。"
     "バイタルサインは記載の時間内のものです。音声の有無は確認していません。"},
    {"check.contents.of-listed",
     "Of {0} sealed files that the ledger lists, {1} are here as listed; of these {2} were decrypted, and "
     "{3} "
     "decoded to as many frames as the ledger states. What the others held, nobody saw.",
     "台帳に記載の封緘ファイル {0} 個のうち、記載どおりに存在するのは{1}です。そのうち {2} 個を復号し、{3} "
     "個は台帳に記載のフレーム数どおりに再生できました。その他の内容は確認していません。"},
    {"check.contents.in-part",
     "Of {0} that are here {1} were decrypted, and {2} of these decoded to as many frames as the ledger "
     "states.",
     "ここにある{0}のうち {1} を復号し、そのうち {2} を台帳に記載のフレーム数どおりに再生できました。"},
    {"check.contents.none-opened",
     "The keys that were given opened nothing. Whether it is unchanged does not depend on that: hashes are "
     "of the sealed files.",
     "与えられた鍵では何も開けませんでした。改変の有無の判定には影響しません（ハッシュ値は封緘後のファイル"
     "のものです）。"},
    {"check.contents.not-asked",
     "No key was given, so nothing was opened. Whether it is unchanged does not depend on that: hashes are "
     "of the sealed files.",
     "鍵が与えられていないため開いていません。改変の有無の判定には影響しません（ハッシュ値は封緘後のファイル"
     "のものです）。"},
    {"check.see-findings", "{0} ({1}, see Findings.)", "{0}（{1}、「所見」を参照）"},
    {"check.notes-too", "{0} ({1}, see Findings.)", "{0}（{1}、「所見」を参照）"},
    // -- the case
    {"case.id", "Case", "症例番号"},
    {"case.opened", "Opened", "開始"},
    {"case.closed", "Closed", "終了"},
    {"case.not-closed", "not closed", "閉じられていない"},
    {"case.id.other-time", "{0}, which names a time that is not that of its opening",
     "{0}（番号の示す時刻は、開始の時刻ではない）"},
    {"case.by-device", "{0}, by the device's clock", "{0}（装置の時計による）"},
    {"case.by-device.set", "{0}, by the device's clock, which was set since the opening, by {1} in all",
     "{0}（装置の時計による。開始後に合計 {1} 合わせられている）"},
    {"case.duration", "Length", "長さ"},
    {"case.reason", "Ended by", "終了理由"},
    {"case.device", "Device", "装置"},
    {"case.recorded-before", "Recorded ahead", "先行記録"},
    {"case.recorded-before.text", "{0} before it was opened (pre-roll)", "開始前の {0} を含む"},
    {"case.marks", "Marks", "マーク"},
    {"case.part", "Part of the case", "症例のうちの部分"},
    {"case.part.text", "from {0} to {1} on the case clock", "症例時刻 {0} から {1} まで"},
    {"case.held", "Holds", "含まれるもの"},
    {"case.left-out", "Leaves out", "含まれないもの"},
    {"case.left-out.text", "everything before and after that time, and the patient data",
     "その前後のすべてと患者情報"},
    {"case.left-out.streams", "the streams {0}; everything before and after that time, and the patient data",
     "系統 {0}、その前後のすべてと患者情報"},
    {"case.made", "Excerpt made", "抜粋の作成"},
    {"case.made.text", "{0} by {1} (the excerpt says so itself; nothing proves it)",
     "{0}、作成者：{1}（抜粋自身の記載であり、証明するものはありません）"},
    {"case.made.at", "{0} (the excerpt says so itself; nothing proves it)",
     "{0}（抜粋自身の記載であり、証明するものはありません）"},
    {"case.made.by", "by {0} (the excerpt says so itself; nothing proves it)",
     "作成者：{0}（抜粋自身の記載であり、証明するものはありません）"},
    {"case.held.of", "{0}: {1} of {2}", "{0}：{2} のうち {1}"},
    {"case.held.of-at-least", "{0}: {1} of at least {2}", "{0}：少なくとも {2} のうち {1}"},
    {"case.unknown", "not known: the ledger cannot be read that far", "不明（台帳を読み取れません）"},
    {"case.carries-on", "Carries on", "引き継いだ症例"},
    {"case.carries-on.text", "case {0}, which was interrupted", "中断された症例 {0}"},
    {"case.size", "Size", "大きさ"},
    {"case.subject", "Patient data", "患者情報"},
    {"case.subject.yes", "sealed in the case; not opened for this report",
     "症例内に封緘（本書では開いていません）"},
    {"case.subject.not-sealed", "said to be sealed in the case, and its file is no sealed one",
     "症例内に封緘と記載されているが、そのファイルは封緘されたものではない"},
    {"case.subject.no", "none in the case", "症例内になし"},
    {"reason.operator", "the operator", "操作者"},
    {"reason.duration", "the time that was set", "設定時間の経過"},
    {"reason.sources-ended", "the end of all sources", "全入力の終了"},
    {"reason.disk-full", "a full disk", "ディスクの満杯"},
    {"reason.other", "“{0}”, as the device states it", "「{0}」（装置の記載）"},
    {"reason.recovered", "recovery after an interruption", "中断後の復旧処理"},
    {"reason.to-be-carried-on", "recovery after an interruption; to be carried on as case {0}",
     "中断後の復旧処理（症例 {0} として引き継ぐ予定）"},
    // -- the chain
    {"chain.lead", "Each part vouches for the one above it. {0}", "各部分は、その上の部分を保証します。{0}"},
    {"chain.lead.external",
     "Who changes one byte of a film would have to change the ledger, the checkpoints that a device signed, "
     "and time stamps that others issued.",
     "映像を1バイトでも変えるには、台帳、装置が署名したチェックポイント、第三者が発行したタイムスタンプをすべ"
     "て変えなければなりません。"},
    {"chain.lead.external-in-part",
     "Who changes one byte of a film would have to change the ledger and the checkpoints that a device "
     "signed. As far as entry {0} of the ledger they would also have to change time stamps that others "
     "issued. Whoever holds the recorder's keys can make what follows anew.",
     "映像を1バイトでも変えるには、台帳と、装置が署名したチェックポイントを変えなければなりません。"
     "台帳の項目 {0} までは、第三者が発行したタイムスタンプも変えなければなりません。"
     "それより後は、記録装置の鍵を持つ者が作り直すことができます。"},
    {"chain.lead.self-issued",
     "Who changes one byte of a film would have to change the ledger, the checkpoints that a device signed, "
     "and time stamps that the recorder's own authority issued. Whoever holds the recorder's keys can make "
     "all of them anew. No time stamp of anybody else could be relied on.",
     "映像を1バイトでも変えるには、台帳、装置が署名したチェックポイント、記録装置自身の認証局が発行したタイム"
     "スタンプをすべて変えなければなりません。記録装置の鍵を持つ者は、そのすべてを作り直すことができます。"
     "それ以外の者による、依拠できるタイムスタンプはありません。"},
    {"chain.lead.none",
     "Who changes one byte of a film would have to change the ledger and the checkpoints that a device "
     "signed. Whoever holds the recorder's keys can make both anew. No time stamp could be relied on.",
     "映像を1バイトでも変えるには、台帳と、装置が署名したチェックポイントを変えなければなりません。"
     "記録装置の鍵を持つ者は、その両方を作り直すことができます。依拠できるタイムスタンプはありません。"},
    {"chain.segments", "Segments", "区間ファイル"},
    {"chain.segments.text",
     "{0}, {1} in all: pictures, vital signs and events, sealed before they were hashed.",
     "{0}、計 {1}。映像・バイタルサイン・イベントを封緘してからハッシュ値を取っています。"},
    {"chain.segments.excerpt",
     "{0}, {1} in all, which is what the excerpt holds of the case: sealed before they were hashed.",
     "{0}、計 {1}（症例のうち抜粋に含まれるもの）。封緘してからハッシュ値を取っています。"},
    {"chain.segments.rekeyed",
     "{0}, {1} in all, which is what the excerpt holds of the case: sealed before they were hashed. {2} of "
     "these were sealed anew since, and are hashed with the original header, which is kept beside.",
     "{0}、計 {1}（症例のうち抜粋に含まれるもの）。封緘してからハッシュ値を取っています。うち {2} "
     "個はその後封緘し直されたもので、傍らに保存された元のヘッダーと合わせてハッシュ値を取ります。"},
    {"chain.segments.bond", "SHA-256 of each file stands in", "各ファイルの SHA-256 を記載"},
    {"chain.ledger", "Ledger", "台帳"},
    {"chain.ledger.text", "{0}, one a line, each numbered; together they have one Merkle root (RFC 6962).",
     "{0}（1行1件、通し番号付き）。全体で一つのマークル根（RFC 6962）を持ちます。"},
    {"chain.ledger.bond", "size and root are signed in", "件数と根に署名"},
    {"chain.checkpoints", "Checkpoints", "チェックポイント"},
    {"chain.checkpoints.text", "{0}, signed by {1}; the last that holds covers {2}.",
     "{0}。{1} が署名。成り立つ最後のものは{2}を覆います。"},
    {"chain.checkpoints.none", "There is no checkpoint that the device signed of these entries.",
     "この項目に対して装置が署名したチェックポイントはありません。"},
    {"chain.checkpoints.bond", "hash of the signed note is stamped by", "署名文書のハッシュ値に押印"},
    {"chain.tokens", "Time stamps", "タイムスタンプ"},
    {"chain.tokens.text", "{0} (RFC 3161) that hold, the earliest of {1}, the latest of {2}.",
     "有効なもの{0}（RFC 3161）。最も早い時刻 {1}、最も遅い時刻 {2}。"},
    {"chain.tokens.others",
     " Of {0} more the times prove nothing here; the table of time stamps says which, the findings why.",
     "このほか {0} 件の時刻はここでは何も証明しません（一覧と所見を参照）。"},
    {"chain.tokens.unproven",
     "{0} (RFC 3161), of which none holds under the roots that were given. The times that they state prove "
     "nothing.",
     "{0}（RFC 3161）。与えられたルート証明書のもとで有効なものはなく、記載の時刻は何も証明しません。"},
    {"chain.tokens.none", "There is none.", "ありません。"},
    {"chain.tokens.bond", "signed by", "署名者"},
    {"chain.authorities", "Authorities", "時刻認証局"},
    {"chain.authorities.judged",
     "{0}. Each is named by the trusted certificate at which its time stamps end; in brackets stands what "
     "the "
     "ledger calls it.",
     "{0}。それぞれ、タイムスタンプの検証が行き着く信頼された証明書の名で示し、括弧内は台帳での呼び名です。"},
    {"chain.authorities.text", "{0}. Their certificates were judged under the roots that were given.",
     "{0}。証明書は、与えられたルートに基づいて判定しました。"},
    {"chain.authorities.unjudged", "{0}. No trusted root was given, so none could be judged.",
     "{0}。信頼するルートが与えられていないため判定できません。"},
    {"chain.authorities.none", "None took part.", "関与した認証局はありません。"},
    // -- the evidence record
    {"evidence.lead",
     "A time stamp proves something only as long as its certificate and its algorithms count. An evidence "
     "record "
     "(RFC 4998) carries the proof on: each further time stamp was made while the one before it still "
     "counted.",
     "タイムスタンプは、証明書と暗号方式が有効な間だけ証明力を持ちます。証拠記録（RFC "
     "4998）は、前のタイムスタンプが有効なうちに次のタイムスタンプを重ねることで、証明を引き継ぎます。"},
    {"evidence.holds", "All {2} ledger entries are proved since {0} by {1}.",
     "台帳の全 {2} 項目が {0} から存在したことが、{1}により証明されています。"},
    {"evidence.holds.part", "The first {2} of {3} ledger entries are proved since {0} by {1}.",
     "台帳の全 {3} 項目のうち最初の {2} 項目が {0} から存在したことが、{1}により証明されています。"},
    {"evidence.holds.excerpt", "The checkpoint of this excerpt and its files are proved since {0} by {1}.",
     "この抜粋のチェックポイントとファイルが {0} から存在したことが、{1}により証明されています。"},
    {"evidence.holds.resealed",
     "The checkpoint of this excerpt is proved since {0} by {1}, with those of its files that nobody sealed "
     "anew.",
     "この抜粋のチェックポイントと、再封印されていないファイルが {0} "
     "から存在したことが、{1}により証明されています。"},
    {"evidence.says", "By the recorder's own word all {2} ledger entries existed at {0}: {1}.",
     "記録装置自身の申告では、台帳の全 {2} 項目が {0} に存在しました：{1}。"},
    {"evidence.says.part",
     "By the recorder's own word the first {2} of {3} ledger entries existed at {0}: {1}.",
     "記録装置自身の申告では、台帳の全 {3} 項目のうち最初の {2} 項目が {0} に存在しました：{1}。"},
    {"evidence.says.excerpt",
     "By the recorder's own word the checkpoint of this excerpt and its files existed at {0}: {1}.",
     "記録装置自身の申告では、この抜粋のチェックポイントとファイルが {0} に存在しました：{1}。"},
    {"evidence.says.resealed",
     "By the recorder's own word the checkpoint of this excerpt existed at {0}, with those of its files that "
     "nobody sealed anew: {1}.",
     "記録装置自身の申告では、この抜粋のチェックポイントと、再封印されていないファイルが {0} "
     "に存在しました：{1}。"},
    {"evidence.one", "one time stamp", "1個のタイムスタンプ"},
    {"evidence.chain", "a chain of {0} time stamps, the newest of {1}",
     "{0}個のタイムスタンプの連鎖（最新は {1}）"},
    {"evidence.self-issued",
     "{0} The recorder's own authority is among those that stamped: no outside clock stands behind these "
     "times, and they prove nothing against whoever has the recorder.",
     "{0}記録装置自身の認証局のタイムスタンプを含むため、これらの時刻に外部の時計の裏付けはなく、"
     "記録装置を持つ者に対しては何も証明しません。"},
    {"evidence.refused", "The evidence record proves nothing here. The verifier says: {0}",
     "証拠記録はここでは何も証明しません。検証プログラムの説明：{0}"},
    {"evidence.unknown", "Whether the evidence record holds could not be checked. The verifier says: {0}",
     "証拠記録が成り立つかどうかは検査できませんでした。検証プログラムの説明：{0}"},
    {"evidence.time", "Time", "時刻"},
    {"evidence.authority", "Authority", "時刻認証局"},
    {"evidence.authority.own", "{0} (the recorder's own)", "{0}（記録装置自身）"},
    {"evidence.authority.unknown", "not known: no trusted root", "不明（信頼するルートなし）"},
    {"evidence.hash", "Hash", "ハッシュ方式"},
    {"evidence.covers", "Covers", "対象"},
    {"evidence.covers.data", "all data that is listed below, and every time stamp before",
     "下記の全データと、それ以前のすべてのタイムスタンプ"},
    {"evidence.covers.link", "the time stamp before", "直前のタイムスタンプ"},
    {"evidence.covered", "It covers {0} ledger entries, from the first on, and {1} files that they name.",
     "対象は、台帳の最初から {0} 件の項目と、それらが名指す {1} 個のファイルです。"},
    {"evidence.taken-in", "{0} entries came later. A later time stamp of the record covers them, since {1}.",
     "その後に加わった {0} 件の項目は、証拠記録の後のタイムスタンプにより {1} 以降対象とされています。"},
    {"evidence.later",
     "{0} entries came later. The record says nothing of them. On the recorder 'kiroku renew --take-in' "
     "brings "
     "them in.",
     "その後に加わった {0} 件の項目は、証拠記録の対象ではありません。記録装置で kiroku renew --take-in "
     "を実行すると取り込まれます。"},
    {"evidence.excerpt",
     "The lines of this excerpt lead to that checkpoint by SHA-256. The record covers the whole case; "
     "whether it "
     "covers the other lines and files as the case has them, an excerpt does not show.",
     "この抜粋の行は SHA-256 によりそのチェックポイントに結び付きます。証拠記録は症例全体を対象とします。"
     "抜粋以外の行とファイルについては、抜粋からは確かめられません。"},
    {"evidence.resealed",
     "{0} segments were sealed anew for a reader of this excerpt. The record covers their lines in the "
     "ledger, which state the hash of the original seal, and not the new seal.",
     "この抜粋の {0} "
     "個の区間は、読者のために再封印されました。証拠記録の対象は、元の封印のハッシュを記した台帳の行であり、"
     "新しい封印ではありません。"},
    {"evidence.not-proved",
     "It proves that this data existed then and has not changed since. It does not prove when before that it "
     "was "
     "recorded, whom the pictures show, or that everything was recorded. Nobody signs that a newer time "
     "stamp "
     "was not taken away.",
     "証明されるのは、これらのデータがその時点で存在し、その後変わっていないことです。それ以前のいつ記録され"
     "たか"
     "、誰の映像であるか、すべてが記録されたかは証明しません。より新しいタイムスタンプが取り除かれていないこ"
     "とも"
     "証明されません。"},
    {"evidence.ends", "It must be renewed before {0}. After that it proves nothing by itself.",
     "{0} までに更新が必要です。それ以降は、それだけでは何も証明しません。"},
    {"evidence.endless", "No end of its newest time stamp is known.",
     "最新のタイムスタンプの期限は知られていません。"},
    // -- witnesses of the log
    {"witness.lead",
     "Witnesses are programs of other people. They cosign the checkpoint of a recorder's log only where it "
     "goes "
     "on from the one that they cosigned before. So nobody can be shown another log. They say nothing of "
     "what "
     "a case holds, and the verdict does not depend on them.",
     "証人は、第三者が運用するプログラムです。前に連署したものに続く場合に限り、装置ログのチェックポイントに"
     "連署"
     "します。そのため、別のログを示すことはできません。症例の内容については何も述べず、判定は証人によりませ"
     "ん。"},
    {"witness.met",
     "The appliance log's first {0} entries, the case's end among them, are witnessed as the policy that was "
     "given asks.",
     "症例の終了を含む装置ログの最初の {0} 項目は、与えられた方針のとおりに証人が連署しています。"},
    {"witness.not-met",
     "The appliance log's first {0} entries are NOT witnessed as the policy that was given asks.",
     "装置ログの最初の {0} 項目は、与えられた方針が求める証人の連署を満たしていません。"},
    {"witness.beginning",
     "Witnesses cosigned the appliance log's first {0} entries. The case's end is not among them.",
     "証人は装置ログの最初の {0} 項目に連署していますが、症例の終了は含まれていません。"},
    {"witness.none", "Nothing shows that anybody cosigned what the appliance log says of this case.",
     "この症例についての装置ログの記載に、誰かが連署したことを示すものはありません。"},
    {"witness.none.excerpt", "Nothing shows that anybody cosigned an appliance log that holds this excerpt.",
     "この抜粋を含む装置ログに、誰かが連署したことを示すものはありません。"},
    {"witness.asks-for-none", "The policy of witnesses that was given asks for nobody.",
     "与えられた証人の方針は、誰の連署も求めていません。"},
    {"witness.name", "Witness", "証人"},
    {"witness.answer", "Answer", "結果"},
    {"witness.time", "Time by its clock", "証人の時計による時刻"},
    {"witness.cosigned", "cosigned", "連署あり"},
    {"witness.absent", "did not cosign", "連署なし"},
    {"witness.invalid", "a line in its name does not hold, or is of a time that has not come",
     "その名の署名行が成り立たないか、まだ来ていない時刻のもの"},
    {"witness.note", "The verifier says: {0}", "検証プログラムの説明：{0}"},
    // -- consent
    {"consent.lead",
     "The appliance log states these consents to the use of the case, and their withdrawals. Who consented "
     "is sealed, and not in this report. The log proves what was entered and when, not that it is true. A "
     "copy "
     "of the log that is older, or that was cut off, states less.",
     "装置ログには、症例の利用への同意とその撤回が次のとおり記されています。同意した人は封印されており、本書"
     "には含まれません。ログが証明するのは記載の内容と時刻であり、その真実性ではありません。古い写しや末尾を"
     "切られたログでは、記載がこれより少なくなります。"},
    {"consent.not-checked", "Could not check: {0}", "確認できませんでした：{0}"},
    {"consent.entered", "Entered, by the device's clock", "記載（装置の時計）"},
    {"consent.kind", "What", "内容"},
    {"consent.purposes", "Purposes", "目的"},
    {"consent.entry", "Entry", "項目"},
    {"consent.given", "consent", "同意"},
    {"consent.withdrawn", "withdrawn", "撤回"},
    {"consent.withdrawn-unsigned",
     "withdrawal that nobody signed in time: it forbids the use, and proves nothing",
     "署名が間に合わなかった撤回。利用を禁じるが、何も証明しない"},
    {"consent.unsigned", "consent that nobody signed in time, and that counts for nothing",
     "署名が間に合わず、効力のない同意"},
    {"consent.further", "{0} more are in the appliance log.", "ほかに {0} 件が装置ログにあります。"},
    // -- streams
    {"stream.name", "Stream", "系統"},
    {"stream.kind", "Kind", "種類"},
    {"stream.from", "From", "開始"},
    {"stream.to", "To", "終了"},
    {"stream.segments", "Segments", "区間"},
    {"stream.frames", "Frames", "フレーム"},
    {"stream.dropped", "Dropped", "欠落"},
    {"stream.gaps", "Gaps", "空白"},
    {"stream.size", "Size", "大きさ"},
    {"stream.erased", "({0} erased)", "（うち {0} 消去）"},
    {"stream.none", "none", "なし"},
    {"stream.nothing", "nothing recorded", "記録なし"},
    {"stream.lead",
     "Times are those of the case clock, which is 0 where the recording begins and is never set. Frames "
     "counts "
     "pictures of a video, and lines of vital signs and events.",
     "時刻は症例時計（記録の始まりを0とし、途中で合わせることのない時計）によります。「フレーム」は、映像では"
     "画像数"
     "、"
     "バイタルサインとイベントでは行数です。"},
    {"stream.lead.excerpt", "Segments and frames are those that this excerpt holds. The case may have more.",
     "区間とフレームは、この抜粋に含まれるものです。症例にはこれ以外もあり得ます。"},
    {"kind.video", "video", "映像"},
    {"kind.audio", "sound", "音声"},
    {"kind.vitals", "vital signs", "バイタル"},
    {"kind.events", "events", "イベント"},
    {"figure.time",
     "Recorded time of each stream (bars), gaps (crossed boxes) and time stamps that hold (lines below)",
     "各系統の記録時間（帯）、欠落（×印の枠）、成立したタイムスタンプ（下段の線）"},
    {"figure.tokens", "time stamps", "タイムスタンプ"},
    {"figure.further", "{0} further streams are not drawn; the table above lists them.",
     "このほか {0} 系統は図示していません（上の表にすべて記載）。"},
    {"gap.from", "From", "開始"},
    {"gap.to", "To", "終了"},
    {"gap.length", "Length", "長さ"},
    {"gap.cause", "Cause, as the recorder stated it", "原因（記録装置の記載）"},
    {"gap.sound", "{0}, sound", "{0}の音声"},
    {"gap.none", "The record states no gap.", "欠落の記載はありません。"},
    {"gap.none.excerpt", "The lines of this excerpt state no gap of its streams in its stretch of time.",
     "この抜粋の行に、その時間内の系統の欠落の記載はありません。"},
    {"gap.further", "{0} further gaps are not printed here; 'kiroku verify --json' lists all.",
     "ほか {0} 件は省略しました（kiroku verify --json で一覧できます）。"},
    {"cause.signal-lost", "no signal came", "信号なし"},
    {"cause.overload", "the recorder could not keep up", "処理が追いつかず"},
    {"cause.disk-full", "the disk was full", "ディスク満杯"},
    {"cause.device-removed", "the capture device was removed", "取込装置の取り外し"},
    {"cause.format-change", "the format of the signal changed", "信号形式の変化"},
    {"cause.paused", "paused", "一時停止"},
    {"cause.suspended", "the recorder's machine slept", "記録装置のスリープ"},
    {"cause.interrupted", "the recorder was interrupted", "記録装置の中断"},
    // -- time
    {"time.lead",
     "A time stamp of an outside authority proves that what it covers existed at its time. What was written "
     "after a time stamp was entered cannot be older than it. {0}",
     "外部の認証局のタイムスタンプは、対象がその時刻に存在したことを証明します。また、タイムスタンプの記入後"
     "に書かれたものは、それより古くはありません。{0}"},
    {"time.lead.external",
     "So each part of the record lies in a bracket between two outside times. Where one of them is missing, "
     "the table says “no limit”.",
     "したがって記録の各部分は、二つの外部時刻の間の範囲に収まります。一方がない場合、表には「限界なし」と記"
     "します。"},
    {"time.lead.there-by-then",
     "Here every time stamp of an outside authority was entered behind what was recorded. So none of them is "
     "an earlier limit of any part of the record: where one is missing, the table says “no limit”.",
     "ここでは外部の認証局のタイムスタンプがすべて、記録されたものより後に記入されています。したがって記録の"
     "どの部分にも"
     "外部の早い方の限界はありません。限界がない場合、表には「限界なし」と記します。"},
    {"time.lead.external-in-part",
     "So each part of the record as far as entry {0} lies in a bracket between two outside times. Where one "
     "of them is missing, the table says “no limit”. No outside clock says by when the rest was written.",
     "したがって記録のうち項目 {0} までの各部分は、二つの外部時刻の間の範囲に収まります。一方がない場合、表に"
     "は「限界なし」と記します。それより後がいつまでに書かれたかを示す外部の時計はありません。"},
    {"time.lead.own-too", "The recorder's own authority issued {0}, too. No bracket rests on what they say.",
     "このほか、記録装置自身の認証局による{0}があります。時刻の範囲には用いていません。"},
    {"time.lead.self-issued",
     "The only time stamps that could be relied on are those of an authority inside the recorder. The "
     "brackets show order. Their times are as right as the recorder's own clock: no clock outside stands "
     "behind them.",
     "依拠できるタイムスタンプは、装置内蔵の認証局によるものだけです。範囲は順序を示します。その時刻の正しさ"
     "は装置の時計に依存し、外部の時計による裏付けはありません。"},
    {"time.earliest", "Not before", "以後"},
    {"time.latest", "Not after", "以前"},
    {"time.widest", "Widest bracket", "最も広い範囲"},
    {"time.no-limit", "no limit", "限界なし"},
    {"time.no-brackets", "There is no bracket: no time stamp could be relied on.",
     "範囲はありません（依拠できるタイムスタンプがないため）。"},
    {"bracket.entries", "Entries", "項目"},
    {"bracket.authorities", "By", "認証局"},
    {"bracket.further",
     "{0} further brackets lie between these and are not printed; 'kiroku verify --json' lists all.",
     "この間の {0} 件は省略しました（kiroku verify --json で一覧できます）。"},
    {"token.authority", "Authority", "認証局"},
    {"token.time", "Time it states", "記載の時刻"},
    {"token.covers", "Covers entries", "対象の項目"},
    {"token.holds", "Proves time", "時刻の証明"},
    {"token.holds.outside", "yes", "する"},
    {"token.holds.own", "order alone: the recorder's own", "順序のみ（記録装置自身のもの）"},
    {"token.holds.no", "no", "しない"},
    {"token.hash", "SHA-256 of the file", "ファイルの SHA-256"},
    {"token.further", "{0} further time stamps lie between these and are not printed; the ledger names all.",
     "この間の {0} 件は省略しました（台帳にすべて記載）。"},
    {"token.missed", "{0} to an authority went without a time stamp; the ledger says when and why.",
     "認証局への要求のうち {0} はタイムスタンプに至りませんでした（日時と理由は台帳に記載）。"},
    {"clock.authority", "Authority", "認証局"},
    {"clock.own", " (self-issued)", "（自己発行）"},
    {"clock.offset", "Ahead of the recorder's clock", "装置の時計との差"},
    {"clock.drift", "Drift in the case", "症例中のずれ"},
    {"clock.compared", "Comparisons", "比較回数"},
    // -- findings
    {"findings.none", "There is nothing to report.", "報告すべき所見はありません。"},
    {"findings.lead",
     "Ordered by weight. The code is stable and explained in Kiroku's description of the format "
     "(docs/reference/format.md). The "
     "last line of each is the verifier's own sentence.",
     "重大な順に示します。コードは不変で、Kiroku "
     "の形式説明書（docs/reference/format.md）に定義されています。各項目の最終行は、"
     "検証プログラムの原文（英語）です。"},
    {"finding.number", "No.", "番号"},
    {"finding.what", "Finding", "所見"},
    {"finding.place", "Place", "箇所"},
    {"finding.meaning", "What it means", "意味"},
    {"finding.entry", "entry {0}", "項目 {0}"},
    {"finding.byte", "byte {0}", "{0} バイト目"},
    {"finding.at", "at {0} of the case", "症例時刻 {0}"},
    {"finding.written", "written at {0} by the recorder's clock, after the case had ended",
     "症例終了後、記録装置の時計で {0} に記載"},
    {"finding.whole", "the case", "症例全体"},
    {"severity.note", "note", "注記"},
    {"severity.gap", "stated gap", "記載された欠落"},
    {"severity.unproven", "could not be checked", "確認できない"},
    {"severity.incomplete", "not finished", "未完了"},
    {"severity.tampered", "does not hold", "成立しない"},
    // -- device and hashes
    {"device.name", "Name", "名称"},
    {"device.key", "Verifier key", "検証鍵"},
    {"device.id", "Key identifier", "鍵識別子"},
    {"device.trusted", "Key trusted", "鍵の信頼"},
    {"device.signatures", "Signatures checked", "検証した署名"},
    {"device.signatures.hardware", "Ed25519 and the key in the device's hardware (ECDSA P-256)",
     "Ed25519 と装置のハードウェア内の鍵（ECDSA P-256）"},
    {"device.signatures.all", "Ed25519, ML-DSA-65 and the key in the device's hardware (ECDSA P-256)",
     "Ed25519、ML-DSA-65、装置のハードウェア内の鍵（ECDSA P-256）"},
    {"device.signatures.both", "Ed25519 and ML-DSA-65", "Ed25519 と ML-DSA-65"},
    {"device.signatures.ed25519", "Ed25519 alone", "Ed25519 のみ"},
    {"device.signatures.none", "none", "なし"},
    {"device.trusted.yes", "yes: among the keys that were given for this check",
     "あり（検査に与えられた鍵に含まれる）"},
    {"device.trusted.no", "no: not among the keys that were given for this check",
     "なし（検査に与えられた鍵に含まれない）"},
    {"device.trusted.unread", "not judged: what names the device was not read",
     "判定せず（装置を名指す部分が読み取られていない）"},
    {"device.trusted.none", "not judged: no key was given for this check",
     "判定せず（鍵が与えられていない）"},
    {"device.lead",
     "The key identifies the recorder. Compare it with what the hospital or the manufacturer published, or "
     "with a "
     "receipt; the copy in the case proves nothing by itself.",
     "この鍵が記録装置を特定します。病院または製造者の公表値、あるいは控えと照合してください。症例内の写しだ"
     "けでは何も証明しません。"},
    {"hash.ledger", "Ledger ({0})", "台帳（{0}）"},
    {"hash.entries", "Entries in the ledger", "台帳の項目数"},
    {"hash.entries.excerpt", "Entries in the excerpt's part of the ledger", "抜粋に含まれる台帳の項目数"},
    {"hash.root", "Merkle root of the ledger", "台帳のマークル根"},
    {"hash.checkpoint", "Last checkpoint that holds", "成り立つ最後のチェックポイント"},
    {"hash.checkpoint-root", "Root that it signs", "署名された根"},
    {"hash.subject", "Sealed patient data", "封緘された患者情報"},
    {"hash.plan", "Sealed plan", "封緘された手術計画"},
    {"hash.log", "Appliance log at the opening", "開始時の装置ログ"},
    {"hash.log.text", "{0}, root {1}", "{0}、根 {1}"},
    {"hash.lead",
     "The ledger names every file of the case with its SHA-256. Whoever has the root and the case has "
     "everything that "
     "is needed to tell a later change.",
     "台帳には症例の全ファイルが SHA-256 "
     "とともに記載されています。根と症例があれば、後からの変更はすべて判ります。"},
    // -- files that a PDF carries along
    {"heading.attached", "Attached files", "添付ファイル"},
    {"attached.lead",
     "This document carries these files of the case along, as they are in its folders checkpoints, tokens "
     "and "
     "authorities. A PDF reader shows them as attachments; the command pdfdetach -saveall saves them. To "
     "whoever trusts the authorities they show when this state of the case existed. The recording itself is "
     "not among them.",
     "本書には、症例フォルダーの checkpoints、tokens、authorities にあるファイルがそのままの形で添付されてい"
     "ます。PDF 閲覧ソフトで添付ファイルとして表示され、コマンド pdfdetach -saveall で取り出せます。認証局を"
     "信頼する人は、これにより症例のこの状態が存在した時刻を確認できます。記録そのものは含みません。"},
    {"attached.name", "File", "ファイル"},
    {"attached.what", "What it is", "内容"},
    {"attached.bytes", "Bytes", "バイト数"},
    {"attached.hash", "SHA-256", "SHA-256"},
    {"attached.checkpoint", "Checkpoint that the device signed", "装置が署名したチェックポイント"},
    {"attached.token", "Time-stamp token (RFC 3161)", "タイムスタンプトークン (RFC 3161)"},
    {"attached.chain", "Certificates that help to build the authority's chain; no reason to trust it",
     "認証局の証明書経路を構築するための証明書（それ自体は信頼の根拠ではありません）"},
    {"attached.record", "Evidence record (RFC 4998)", "証拠記録 (RFC 4998)"},
    {"attached.log-proof",
     "Proof from the appliance log of how the case ended (C2SP tlog-proof), for whoever has no log",
     "症例の終了を装置ログから示す証明（C2SP tlog-proof）。ログを持たない人のためのものです"},
    {"attached.receipt", "Receipt of the recording", "手術記録の控え"},
    {"attached.further",
     "The case has more such time stamps than the first and the last 12 that are attached.",
     "添付したのは最初と最後の 12 件のタイムスタンプです。残りは症例フォルダーにあります。"},
    // -- repeating
    {"repeat.lead",
     "Nobody needs Kiroku to check this record. With the case folder as the working directory and the tools "
     "of any "
     "Linux system:",
     "この記録の検査に Kiroku は必要ありません。症例フォルダーを作業ディレクトリとし、一般的な Linux "
     "の道具で確認できます。"},
    {"repeat.hash", "The ledger is the one that this report speaks of:", "台帳が本書の対象であること："},
    {"repeat.files", "Every file is as the ledger lists it (no output means yes):",
     "全ファイルが台帳のとおりであること（何も表示されなければ一致）："},
    {"repeat.files.erased",
     "Every file is as the ledger lists it ({0} that were erased are named as missing, and nothing else is):",
     "全ファイルが台帳のとおりであること（消去された{0}だけが、ないものとして表示されます）："},
    {"repeat.token", "The last time stamp is over the checkpoint, under roots that you trust:",
     "最後のタイムスタンプが、信頼するルートの下でチェックポイントに対するものであること："},
    {"repeat.all",
     "The whole check, with the Merkle tree and the signatures, is a script of one page in Kiroku's "
     "documentation: "
     "docs/how-to/verify-with-stock-tools.md. With Kiroku, the same as this report:",
     "マークル木と署名を含む検査の全体は、Kiroku の文書 docs/how-to/verify-with-stock-tools.md "
     "に1ページの手順書としてあります。"
     "Kiroku を用いる場合（本書と同じ検査）："},
    {"repeat.newer",
     "With a version of Kiroku that knows this format:", "この形式に対応する版の Kiroku で："},
    {"repeat.excerpt",
     "The whole check of an excerpt, with its Merkle proofs, is a script of its own in Kiroku's "
     "documentation: "
     "docs/how-to/verify-with-stock-tools.md. With Kiroku, the same as this report:",
     "マークル証明を含む抜粋の検査の全体は、Kiroku の文書 docs/how-to/verify-with-stock-tools.md "
     "に専用の手順書としてあります。Kiroku を用いる場合（本書と同じ検査）："},
    // -- about
    {"about.by", "Made by", "作成者"},
    {"about.when", "Made", "作成日時"},
    {"about.with", "Made with", "使用プログラム"},
    {"about.given", "Given for the check", "検査に与えられたもの"},
    {"about.given.nothing", "nothing: neither keys nor roots", "なし（鍵・ルートとも）"},
    {"given.devices", "trusted device keys: {0}", "信頼する装置の鍵：{0}"},
    {"given.roots", "trusted time-stamping roots: {0}", "信頼する時刻認証ルート：{0}"},
    {"given.own-roots", "roots of the recorder's own authority: {0}", "装置内蔵の時刻認証局のルート：{0}"},
    {"given.log", "appliance log: {0}", "装置ログ：{0}"},
    {"given.against", "checkpoints kept elsewhere: {0}", "別に保管されたチェックポイント：{0}"},
    {"given.evidence", "evidence record that had to hold: {0}", "成り立つべき証拠記録：{0}"},
    {"given.policy", "until when algorithms count: {0}", "アルゴリズムの有効期限：{0}"},
    {"given.proof", "proof from the appliance log: {0}", "装置ログの証明：{0}"},
    {"given.witnesses", "policy of witnesses: {0}", "証人の方針：{0}"},
    {"given.identity", "a key to open the recording: {0}", "記録を開く鍵：{0}"},
    {"about.lead",
     "This report describes what a program found in the case folder on the date above. The evidence is the "
     "case "
     "folder; the report is a guide to it. Times are UTC.",
     "本書は、上記の日時にプログラムが症例フォルダーについて検出した内容を述べるものです。証拠は症例フォルダ"
     "ーであり、"
     "本書はその案内です。時刻は協定世界時（UTC）です。"},
    // -- words
    {"word.segment", "Segment", "区間ファイル"},
    {"word.segment.text", "A few seconds of one stream in a file, encrypted for those who may watch it.",
     "一系統の数秒分を収めたファイル。閲覧を許された者だけが開けるよう暗号化されている。"},
    {"word.hash", "Hash (SHA-256)", "ハッシュ値（SHA-256）"},
    {"word.hash.text",
     "A number computed from a file. No two different files with the same one have ever been found.",
     "ファイルから計算される数値。同じ値を持つ異なる二つのファイルは、いまだ見つかっていない。"},
    {"word.ledger", "Ledger", "台帳"},
    {"word.ledger.text", "The numbered list of everything that was recorded, with its hash and time.",
     "記録されたすべてを、ハッシュ値と時刻とともに番号順に並べた一覧。"},
    {"word.root", "Merkle root", "マークル根"},
    {"word.root.text",
     "One hash over the whole ledger, made so that a part can be proved without the rest (RFC 6962).",
     "台帳全体に対する一つのハッシュ値。一部だけでも証明できるように作られている（RFC 6962）。"},
    {"word.checkpoint", "Checkpoint", "チェックポイント"},
    {"word.checkpoint.text", "Size and root of the ledger at a moment, signed by the recording device.",
     "ある時点の台帳の件数と根に、記録装置が署名したもの。"},
    {"word.token", "Time stamp", "タイムスタンプ"},
    {"word.token.text",
     "A signed statement of an authority that a hash was known to it at a time (RFC 3161).",
     "あるハッシュ値をその時刻に受け取ったことを、認証局が署名して証するもの（RFC 3161）。"},
    {"word.bracket", "Bracket", "時刻の範囲"},
    {"word.bracket.text", "The times of two time stamps between which a part of the record was written.",
     "記録の一部が書かれた時点を挟む、二つのタイムスタンプの時刻。"},
    {"word.gap", "Gap", "欠落"},
    {"word.gap.text", "Time in which nothing could be recorded, stated by the recorder when it happened.",
     "記録できなかった時間。発生時に装置自身が記載する。"},
    // -- the receipt
    {"receipt.lead",
     "This page names one state of one recording. Whoever keeps it can tell later whether the recording that "
     "is shown "
     "then is the same.",
     "この控えは、ある記録のある時点の状態を特定します。これを保管すれば、後日示された記録が同一かどうかを確"
     "かめられます。"},
    {"receipt.root", "Final ledger root", "台帳の最終の根"},
    {"receipt.root-hex", "The same in hexadecimal", "同（16進表記）"},
    {"receipt.size", "Ledger entries covered", "対象の台帳項目数"},
    {"receipt.evidence", "Evidence record", "証拠記録"},
    {"receipt.witnesses", "Witnesses of the log", "装置ログの証人"},
    {"receipt.qr.caption",
     "The QR code holds the last checkpoint of the case as it lies in the folder ({0}): case, size and root, "
     "signed by "
     "the device.",
     "QRコードには、症例フォルダー内の最後のチェックポイント（{0}"
     "）がそのまま入っています。症例番号・項目数・根に装置が署名したものです。"},
    {"receipt.qr.caption.ed25519",
     "The QR code holds the last checkpoint of the case as it lies in the folder ({0}): case, size and root, "
     "signed by the device. Further signatures in that file are left out: they are too long for a QR code.",
     "QRコードには、症例フォルダー内の最後のチェックポイント（{0}"
     "）の症例番号・項目数・根と、装置の署名が入っています。ファイル内のその他の署名は、QRコードに収まらない"
     "ため"
     "省かれています。"},
    {"receipt.check",
     "To check the recording against this page later:", "後日、記録をこの控えと照合するには："},
    {"receipt.check.scan",
     "1. Scan the QR code into a file, and compare it with the one in the case. No output means they are the "
     "same.",
     "1. QRコードを読み取ってファイルに保存し、症例内のものと比べます。何も表示されなければ同一です。"},
    {"receipt.check.verify",
     "2. Verify the case under the device key of this page (docs/reference/report.md says how to do it "
     "without "
     "Kiroku):",
     "2. この控えの装置の鍵で症例を検証します（Kiroku を用いない方法は docs/reference/report.md）："},
    {"receipt.attached", "The PDF carries along: {0} (pdfdetach -saveall saves them).",
     "PDF の添付ファイル：{0}（pdfdetach -saveall で保存）。"},
    {"receipt.attached.log-proof",
     "With --proof {0} the command above also tells how the case ended by the recorder's log.",
     "上のコマンドに --proof {0} を加えると、装置ログに記載された症例の終了も確認できます。"},
    {"receipt.keep", "Keep it where whoever keeps the recording cannot change it.",
     "記録の保管者が書き換えられない場所に保管してください。"},
    {"receipt.not-intact",
     "This receipt names the last checkpoint that holds. It does not say that the recording is whole: "
     "see the verdict above, and the report.",
     "この控えは成り立つ最後のチェックポイントを特定するもので、記録が完全であることを示すものではありませ"
     "ん（上記の判定と検証報告書を参照）。"},
    {"qr.description", "QR code of the signed checkpoint", "署名付きチェックポイントのQRコード"},
    // -- numbers of things
    {"one.entry", "{0} ledger entry", "台帳項目 {0} 件"},
    {"many.entry", "{0} ledger entries", "台帳項目 {0} 件"},
    {"one.log-entry", "{0} entry", "{0} 件"},
    {"many.log-entry", "{0} entries", "{0} 件"},
    {"one.file", "{0} file", "{0} ファイル"},
    {"many.file", "{0} files", "{0} ファイル"},
    {"one.segment", "{0} sealed file", "封緘ファイル {0} 個"},
    {"many.segment", "{0} sealed files", "封緘ファイル {0} 個"},
    {"one.checkpoint", "{0} checkpoint", "チェックポイント {0} 件"},
    {"many.checkpoint", "{0} checkpoints", "チェックポイント {0} 件"},
    {"one.token", "{0} time stamp", "タイムスタンプ {0} 件"},
    {"many.token", "{0} time stamps", "タイムスタンプ {0} 件"},
    {"one.request", "{0} request", "{0} 件"},
    {"many.request", "{0} requests", "{0} 件"},
    {"one.note", "{0} note", "注記 {0} 件"},
    {"many.note", "{0} notes", "注記 {0} 件"},
    {"one.finding", "{0} finding", "所見 {0} 件"},
    {"many.finding", "{0} findings", "所見 {0} 件"},
});

}  // namespace kiroku::report
