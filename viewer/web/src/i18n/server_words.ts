// What the server says when it refuses something, in the page's language. Its sentences are English (viewer); a test
// reads them from the sources and fails where one has no Japanese.
import { language } from '@/i18n/i18n';
import { type SentencePair, SentencePatterns } from '@/i18n/sentence_patterns';

export const kServerSentences: readonly SentencePair[] = [
  // Signing in, sessions, roles, users
  ['sign in first', 'サインインしてください'],
  ['the session has ended', 'セッションが終了しました。サインインしてください'],
  ['the name or the password is wrong', '名前またはパスワードが正しくありません'],
  ['too many failures: try again in {seconds} s', '失敗が続いたため、{seconds} 秒後に再試行してください'],
  ['many are signing in now: try again in a moment', '同時に多くの人がサインインしています。少し待って再試行してください'],
  ['a password is never as long as this', 'パスワードが長すぎます'],
  [
    'this link has been used, or was never given out: start the viewer anew',
    'このリンクは使用済みか、発行されたものではありません。ビューアを起動し直してください',
  ],
  ['the role {role} may not do this', '{role}の役割ではこの操作はできません'],
  ['a role is operator, surgeon, auditor or administrator', '役割は、操作者、外科医、監査者、管理者のいずれかです'],
  ['nobody changes their own role: ask another administrator', '自分自身の役割は変更できません。ほかの管理者に依頼してください'],
  ['nobody resets their own password: choose a new one with the one of now', '自分自身のパスワードは再発行できません。現在のパスワードで変更してください'],
  ['this password was for signing in once: choose your own first', '一回限りのパスワードです。先に自分のパスワードを決めてください'],
  ['the time of this one-time password is over: ask an administrator for another', '一回限りのパスワードの期限が過ぎました。管理者に再発行を依頼してください'],
  ['this one-time password was used already: ask an administrator for another', '一回限りのパスワードは使用済みです。管理者に再発行を依頼してください'],
  ['this session has no password to change', 'このセッションに変更できるパスワードはありません'],
  ['the password of now is wrong', '現在のパスワードが正しくありません'],
  ['choose another password than the one of now', '現在とは別のパスワードにしてください'],
  ['an administrator changed this user meanwhile: sign in again', 'その間に管理者がこの利用者を変更しました。サインインし直してください'],
  ['this user was changed meanwhile: sign in again', 'その間にこの利用者が変更されました。サインインし直してください'],
  ['this user was removed', 'この利用者は削除されました'],
  ['nobody removes themselves', '自分自身を削除することはできません'],
  ['there is no user {name}', '利用者 {name} は存在しません'],
  ["'identity' is missing: the text of an identity file", '識別鍵がありません。識別鍵ファイルの内容を指定してください'],
  ["'identity' is neither an identity file's text nor base64 of one", '識別鍵の形式が正しくありません'],
  ['recordings are locked: unlock them with an identity first', '記録は施錠されています。識別鍵で解錠してください'],
  ['the appliance log cannot be written, so nothing is shown', '装置ログに書き込めないため、何も表示しません。管理者に連絡してください'],
  // Rooms of the fleet
  [
    "this request is over: begin again with 'kiroku fleet enrol' on the appliance",
    'この登録要求は終了しました。装置で「kiroku fleet enrol」をやり直してください',
  ],
  [
    "there is no authority of the fleet in {folder}: 'kiroku-fleet serve' makes one where reports are taken ([reports] of fleet.toml), or copy authority.key and authority.pem from the server that has it",
    '{folder} に施設の認証局がありません。「kiroku-fleet serve」が報告を受けるサーバで作成します（fleet.toml の [reports]）。または、それを持つサーバから authority.key と authority.pem を複製してください',
  ],
  [
    '{file} is open to others than its owner: chmod 600, and think of who may have read it',
    '{file} は所有者以外にも読めます。chmod 600 とし、誰が読んだ可能性があるかを検討してください',
  ],
  ['{file} is not the key of {certificate}: copy both from one server', '{file} は {certificate} の鍵ではありません。一つのサーバから両方を複製してください'],
  // Rooms
  ['refused too often: look at what the room does, and try again in {seconds} s', '拒否が続いています。室の状態を確かめ、{seconds} 秒後に再試行してください'],
  ['room {room} is recording already', '室 {room} は既に記録中です'],
  ['room {room} is not recording', '室 {room} は記録していません'],
  [
    'room {room} is recording case {now}, and not case {id}: nothing was done',
    '室 {room} が記録しているのは症例 {now} で、症例 {id} ではありません。何も行っていません',
  ],
  ['room {room} is not recording case {id}: nothing was done', '室 {room} は症例 {id} を記録していません。何も行っていません'],
  ['room {room} has begun case {now} meanwhile: nothing was done', '室 {room} はその間に症例 {now} を開始しました。何も行っていません'],
  ["there is no room named '{room}'", '室「{room}」は存在しません'],
  // Patients, procedures and staff
  ['patient, procedure and staff are sealed: unlock them with an identity first', '患者、術式、スタッフは封印されています。識別鍵で解錠してください'],
  ["give 'subject' or 'procedure', not both", '患者は、入力するか一覧から選ぶかのどちらか一方にしてください'],
  ["give a 'subject' or a 'procedure'", '患者を入力するか、一覧から選んでください'],
  ["'subject' must be a JSON object of at most {n} bytes", '入力された患者情報が長すぎます（{n} バイトまで）'],
  ["'plan' must be the hash of a sealed plan: 64 hexadecimal digits", '計画の指定が正しくありません'],
  ['the appliance log knows no such plan: seal it here first, by kiroku plan seal', '装置ログにこの計画はありません。先に kiroku plan seal で封印してください'],
  // Cases, exports, reports, verification
  ['there is no case {id}', '症例 {id} は存在しません'],
  ['the store has no case {id}', '保管庫に症例 {id} はありません'],
  ['the catalogue has no case {id}', 'カタログに症例 {id} はありません'],
  ['no appliance {name} is enrolled', '装置 {name} は登録されていません'],
  ['too many wrong codes were entered: try again in {seconds} s', '誤ったコードが続いたため、{seconds} 秒後に再試行してください'],
  ["a code has 16 letters and digits, as 'kiroku fleet enrol' shows it: {example}", 'コードは kiroku fleet enrol が表示する 16 文字の英数字です：{example}'],
  [
    "no appliance that waits shows this code: compare it with the appliance's, which shows it for ten minutes. If it is the same, somebody stands between the appliance and this server",
    'このコードを表示して待っている装置はありません。装置の表示（10 分間有効）と比べてください。同じ場合は、装置とこのサーバの間に誰かがいます',
  ],
  [
    'an appliance named {name} is enrolled already: give this one another name, or revoke the other one first ({command})',
    '装置 {name} はすでに登録されています。別の名前にするか、先に登録を取り消してください',
  ],
  ['nothing was recorded there', 'その時点の記録はありません'],
  ["stream '{stream}' has no sound", 'ストリーム「{stream}」に音声はありません'],
  ['the vital signs of this case are still being read', 'この症例のバイタルサインを読み込み中です'],
  ['ask for ten minutes at most', '一度に読めるのは 10 分までです'],
  ['other files are being made: try again in a while', '別のファイルを作成中です。しばらくして再試行してください'],
  ['three files of yours are being downloaded: try again when one of them is there', 'ファイルを3つダウンロード中です。終わってから再試行してください'],
  ['as many files are being downloaded as this disk has room for: try again in a while', 'ダウンロード中のファイルが多すぎます。後で再試行してください'],
  ['two files of yours are being made: try again when one of them is there', 'あなたのファイルを2つ作成中です。どちらかができてから再試行してください'],
  ['another document is being made: try again in a moment', '別の文書を作成中です。少し待って再試行してください'],
  [
    'the disk has no room for this file beside what a recorder may need: choose a shorter time',
    '記録のための容量を残すと、ディスクに空きがありません。短い範囲を選んでください',
  ],
  [
    'the disk has no room for this file beside what a recorder may need: {advice}',
    '記録のための容量を残すと、ディスクに空きがありません。不要なものの削除を管理者に依頼してください',
  ],
  [
    'the disk of {folder} could not be asked how much room it has ({why}), so nothing is written: see to the disk and its mount',
    'ディスク {folder} の空き容量を確認できないため（{why}）、何も書き込みません。ディスクとそのマウントを確かめてください',
  ],
  [
    'more was done than the appliance log takes of one person at a time: try again in {seconds} s',
    '短い時間に操作が多すぎます。{seconds} 秒後に再試行してください',
  ],
  // Consent
  ["this site demands a purpose of every export: say which with 'purpose'", 'この施設では書き出しごとに目的が必要です。目的を選んでください'],
  ["'{purpose}' is no purpose of this site: nothing was handed out", '「{purpose}」はこの施設の目的にありません。何も書き出していません'],
  [
    'no consent to the purpose {purpose} was given for case {id}: nothing was handed out',
    '症例 {id} には、目的「{purpose}」への同意がありません。何も書き出していません',
  ],
  [
    'the consent to the purpose {purpose} was withdrawn for case {id} on {time} (entry {n} of the appliance log): nothing was handed out',
    '症例 {id} の目的「{purpose}」への同意は {time} に撤回されました（装置ログの第 {n} 項目）。何も書き出していません',
  ],
  [
    'entry {n} of the appliance log withdraws the consent to the purpose {purpose} for case {id}, and nobody signed that entry in time: nothing was handed out',
    '装置ログの第 {n} 項目が症例 {id} の目的「{purpose}」への同意を撤回していますが、署名が間に合っていません。何も書き出していません',
  ],
  ['could not check the consent, so nothing is handed out: {why}', '同意を確認できなかったため、何も書き出しません：{why}'],
  ["the site's purposes cannot be read, so nothing is handed out: {why}", '施設の目的を読み込めないため、何も書き出しません：{why}'],
  ['{why}: nothing was handed out', '何も書き出していません：{why}'],
  ['this case has not been verified here as it is now', '現在の状態のこの症例は、まだここで検証されていません'],
  ['many cases wait to be verified: try again later', '検証待ちの症例が多いため、後で再試行してください'],
  ['the appliance log is being verified already', '装置ログはすでに検証中です'],
  // Rooms, live pictures, guests
  ["'text' must be a text of 1 to {n} bytes", 'マークの文は 1 から {n} バイトまでです'],
  [
    'no pictures of {room}/{stream} are recorded by this program; live pictures come from kirokud, where kiroku.toml has a [viewer] section',
    'このプログラムは {room}/{stream} の映像を記録していません。ライブ映像は、kiroku.toml に [viewer] がある kirokud が配信します',
  ],
  ['there are no live pictures of a room {room} to invite anybody to', '招待できる手術室 {room} のライブ映像がありません'],
  ['there are no live pictures of a room {room}', '手術室 {room} のライブ映像がありません'],
  ['no vital signs of {room} are recorded by this program', 'このプログラムは {room} のバイタルサインを記録していません'],
  ['live pictures take no messages', 'ライブ映像にメッセージは送れません'],
  ['this invitation is for another room', 'この招待は別の手術室のものです'],
  [
    'this invitation has ended, was used before, or was never given out: ask for another',
    'この招待は終了したか、使用済みか、発行されたものではありません。新しい招待を依頼してください',
  ],
  ["'guest' must be a name of 1 to {n} bytes", '招待する方の名前は 1 から {n} バイトまでです'],
  [
    "'guest' holds {what}, which is obeyed or cannot be seen where it is shown: write it without",
    '名前に、表示できない文字（{what}）が含まれています。除いて入力してください',
  ],
  ["'minutes' must be from 1 to {n}", '招待の時間は 1 分から {n} 分までです'],
  ['no invitation {id} lasts', '招待 {id} はすでに終了しています'],
  ['{n} invitations have not ended yet: end one first', '終了していない招待が {n} 件あります。先にどれかを終了してください'],
  // Plans, comparisons, matching by hand
  ["the case has no such file of a comparison '{name}'", '比較「{name}」のファイルがこの症例にありません'],
  ["the case has no stream of pictures '{stream}'", 'この症例に映像「{stream}」はありません'],
  [
    "'geometry' must say how the fluoroscope sees the patient: an object, as of kiroku sim drr",
    '透視装置の幾何情報のファイルが正しくありません（kiroku sim drr の形式）',
  ],
  ['a plan is being read for you already: wait until that is done', '計画をすでに読み込み中です。終わるまでお待ちください'],
  ['plans are being read for others: try again', 'ほかの人のために計画を読み込み中です。再試行してください'],
  [
    'reading the plan {plan} and its case took longer than {n} s, and was ended: try again when the machine has less to do',
    '計画 {plan} と症例の読み込みが {n} 秒を超えたため中止しました。負荷が下がってから再試行してください',
  ],
  ['the sealed plan {plan} cannot be read', '封印された計画 {plan} を読み込めません'],
  [
    "a comparison cannot be called '{name}': use at most 32 small letters, digits and hyphens",
    '比較の名前「{name}」は使えません。英小文字、数字、ハイフンで 32 文字以内にしてください',
  ],
  ["the case has a comparison '{name}' already: give this one another name", '比較「{name}」はすでにあります。別の名前にしてください'],
  ['another comparison is being made by {name}: wait until it is done', '{name} が別の比較を作成中です。終わるまでお待ちください'],
  ['another comparison is being made{of}: wait until it is done', '別の比較を作成中です。終わるまでお待ちください'],
  ['no comparison of this case was asked for since the server began', 'サーバの起動後、この症例の比較は依頼されていません'],
  ['no comparison of this case is being made', 'この症例の比較は作成中ではありません'],
  ['it is made by {name}: they or an administrator can stop it', '{name} が作成中です。中止できるのは本人か管理者です'],
  ['the program that shows the plan answered with what is no answer', '計画を表示するプログラムの応答が正しくありません'],
  ['this case was not recorded by a sealed plan', 'この症例は封印された計画に基づく記録ではありません'],
  ['the program that compares is not installed: install Kiroku anew', '比較プログラムがありません。Kiroku を再インストールしてください'],
  [
    'the plan that this case was recorded by is not here: put its folder into {folder}',
    'この症例の計画がここにありません。計画のフォルダーを {folder} に置いてください',
  ],
  ['{name} picks points on another plan: wait until that is done', '{name} が別の計画で点を選択中です。終わるまでお待ちください'],
  ['you ask for pictures of the plan already: try again in a moment', '計画の画像をすでに要求中です。少し待って再試行してください'],
  ['others ask for pictures of the plan: try again', 'ほかの人が計画の画像を要求中です。再試行してください'],
  ['a picture of the plan took too long', '計画の画像の作成に時間がかかりすぎました'],
  // Planning
  [
    "{what} is saved under letters, digits, spaces, '-', '_' and '.', at most 120 bytes of them",
    '名前は、英数字、空白、「-」「_」「.」で 120 バイト以内にしてください',
  ],
  ['there is no plan of that name here', 'その名前の計画はここにありません'],
  [
    'this plan names no CT that could be shown: give its "volume" a file or folder',
    'この計画には表示できる CT がありません。"volume" にファイルかフォルダーを指定してください',
  ],
  ['that handle is gone: take one that the picture shows', 'そのハンドルはもうありません。画像に表示されているハンドルを選んでください'],
  ['handle {n} would leave the organ: drag it to a place on its surface', 'ハンドル {n} が臓器から外れます。臓器の表面にドラッグしてください'],
  [
    "handle {n} would lie {mm} mm deep in a cut: drag it to a place on the organ's surface",
    'ハンドル {n} が切開面の中（深さ {mm} mm）に入ります。臓器の表面にドラッグしてください',
  ],
  ['handle {n} would lie at handle {other}: leave at least {mm} mm between them', 'ハンドル {n} がハンドル {other} に重なります。{mm} mm 以上離してください'],
  ['a depth of {mm} mm needs a blade whose edge is longer: it has {edge} mm', '深さ {mm} mm には刃が短すぎます（刃の長さ {edge} mm）。浅くしてください'],
  ['the line is too short to be cut: draw it longer', '線が短すぎて切開できません。長く引いてください'],
  ['the line does not cross the organ: draw it over the organ', '線が臓器にかかっていません。臓器の上に引いてください'],
  [
    "the line goes over the organ's border, a fold or an open cut: it is cut straight down and has no handles; draw it on one surface alone to change it afterwards",
    '線が臓器の縁、ひだ、または開いた切開を越えるため、視線に沿って切り離します（ハンドルはありません）。後で変更するには、ひと続きの表面の上だけに引いてください',
  ],
  ['the plan could not be read back', '保存した計画を読み戻せませんでした'],
  ["there is a plan '{name}' already: save it under another name", '計画「{name}」はすでにあります。別の名前で保存してください'],
  [
    'as many people plan here as this machine can compute for ({n}): try again when somebody has left',
    'この機械で同時に計画できる人数（{n}）に達しています。誰かが終えてから再試行してください',
  ],
  ['others look at what was consented to: try again in a moment', '他の人が同意の状況を確認中です。しばらくしてからもう一度お試しください'],
  [
    'you look at what was consented to already, on another page: try again in a moment',
    'すでに別のページで同意の状況を確認中です。しばらくしてからもう一度お試しください',
  ],
  ['you plan here already, on another page: close that first', 'すでに別のページで計画中です。先にそちらを閉じてください'],
  ['there are {n} plans here, as many as are kept: have some removed', '計画がすでに {n} 件あり、これ以上保存できません。不要な計画の削除を依頼してください'],
  ['this plan has more steps than one that can be opened again: undo some', '手順が多すぎて再び開けません。いくつか元に戻してください'],
  ['a plan must be opened first', '先に計画を開いてください'],
  ['a plan is open on this connection already', 'この接続ではすでに計画が開かれています'],
  // The breathing workbench
  ["there is a file '{name}.json' already: save it under another name", 'ファイル「{name}.json」はすでにあります。別の名前で保存してください'],
  [
    'there are {n} models beside this one, as many as are kept: have some removed',
    'このモデルのほかに {n} 個のモデルがあり、これ以上は保存できません。不要なものを削除してもらってください',
  ],
  [
    'as many people work here as this machine can compute for ({n}): try again when somebody has left',
    'この機械で同時に作業できる人数（{n}）に達しています。誰かが終えてから再試行してください',
  ],
  ['you work at this lung already, on another page: close that first', 'すでに別のページでこの肺を開いています。先にそちらを閉じてください'],
  ['another fit is being computed on this machine: try again when it is done', 'この装置で別のあてはめを計算中です。終わってから再試行してください'],
  ['you have a fit computed already, on another page: wait for that, or cancel it', '別のページであてはめを計算中です。終わるのを待つか、中止してください'],
  ['you have a fit computed already: wait for that, or cancel it', 'あてはめを計算中です。終わるのを待つか、中止してください'],
  ['a model is being sealed: wait until its time-stamps have come', 'モデルを封印しています。時刻証明が届くまでお待ちください'],
  [
    "'{file}' has changed since this lung was opened, so that what is shown would not be what is saved: start the workbench anew",
    'この肺を開いた後に「{file}」が変更されたため、表示中の内容を保存できません。作業台を起動し直してください',
  ],
  [
    "this server has no search key: 'kiroku-fleet serve --search-key FILE' gives it one",
    'このサーバーには検索用の鍵がありません。kiroku-fleet serve --search-key FILE で渡してください',
  ],
  ["to search give 'patient' or 'procedure' or both", '検索するには患者番号か術式コードを入力してください'],
  ["of what '{name}' says nothing can be searched", '入力された内容では検索できません（{name}）'],
  ["'{name}' stands beside '{other}'", '{name} は {other} とともに指定してください'],
  [
    "no node of the lung is of the group {group}, so that it cannot be moved: give it some in 'groups', or take back what took them away",
    'グループ {group} の節点がないため動かせません。節点を割り当てるか、取り除いた変更を元に戻してください',
  ],
  [
    "the groups are of a surface of {n} nodes, this lung's has {own}: load the page again",
    'グループは節点 {n} 個の表面のものですが、この肺の表面の節点は {own} 個です。ページを読み直してください',
  ],
  ['this server seals no models: it serves no home of its own', 'このサーバーではモデルを封印できません'],
  ['the fit was cancelled', 'あてはめを中止しました'],
  ['finding how the patient lies', '患者の位置を求めています'],
  ['trying other ways round', 'ほかの向きを試しています'],
  ['fitting in {columns} x {rows} pixels', '{columns} x {rows} 画素であてはめています'],
  ['looking for the tumour', '腫瘍を探しています'],
  ['more was asked for than can be computed', '計算が追いつきません'],
  // Programs behind the viewer
  ['the program behind this page does not run: start kiroku {command}', 'このページのプログラムが動いていません。kiroku {command} を起動してください'],
  ['others wait for the program behind this page: try again in a moment', 'ほかの人がこのページのプログラムを待っています。少し待って再試行してください'],
  ['you wait for the program behind this page already: try again in a moment', 'このページのプログラムの応答を待っています。少し待って再試行してください'],
  ['the program behind this page takes less than is sent: try again later', 'このページのプログラムの受信が追いつきません。後で再試行してください'],
  ['the program behind this page takes nothing of what is sent: try again later', 'このページのプログラムが受信していません。後で再試行してください'],
  ['the program behind this page does not answer in time', 'このページのプログラムが時間内に応答しません'],
  ['the program behind this page answered with what is no answer', 'このページのプログラムの応答が正しくありません'],
  ['the program behind this page has ended: try again once it runs', 'このページのプログラムが終了しました。再び動いてから再試行してください'],
  // Training
  ['an attempt must begin first', '先に試行を始めてください'],
  ['an attempt has begun on this connection already', 'この接続ではすでに試行が始まっています'],
  ["a test is with fingertips: leave 'instrument' out", 'テストは指先で行います。器具を外してください'],
  ["an expert's hand has fingertips: leave out 'expert' or 'instrument'", '熟練者の手は指先です。熟練者の手か器具のどちらかを外してください'],
  ['this is a simulated trainee, no person', 'これは模擬の訓練者であり、人ではありません'],
  ['only the user bound to {name}, or an administrator, may train so', '{name} に結び付けられた利用者か管理者だけが、この名前で訓練できます'],
  ["{name} trains as '{trainee}' already", '{name} はすでに「{trainee}」として訓練しています'],
  ['there is no trainee of that name whose results you may see', '結果を見られるその名前の訓練者はいません'],
  ['many attempts were begun one after the other: begin the next one in {seconds} s', '試行が続けて始められました。次は {seconds} 秒後に始めてください'],
  ['{name} is training already', '{name} はすでに訓練中です'],
  ['all places for training are taken: try again when an attempt has ended', '訓練の空きがありません。どれかの試行が終わってから再試行してください'],
  ['this server makes no cases of attempts: start it with --seal', 'このサーバは試行を症例にしません。--seal を付けて起動してください'],
  ['sealing makes a case, which surgeons and administrators may: ask one of them', '封印すると症例になります。外科医か管理者に依頼してください'],
  ['there is no such attempt of a trainee that you may train as', '該当する試行がありません'],
  ['this attempt is being sealed: wait a moment', 'この試行は封印中です。少しお待ちください'],
  ['this attempt was sealed as {id} already', 'この試行はすでに {id} として封印されています'],
  [
    "an attempt can be sealed until its trainee's next one is over, and while the server runs",
    '試行を封印できるのは、同じ訓練者の次の試行が終わるまで、かつサーバが動いている間です',
  ],
  ['a checklist is filled in by who supervises trainees: ask an administrator', 'チェックリストは訓練を監督する管理者が記入します。管理者に依頼してください'],
  ['this attempt runs, or was broken off: nothing can be said of it', 'この試行は進行中か中断されたため、評価できません'],
  ['this attempt was not sealed', 'この試行は封印されていません'],
  // Anything
  ['there is nothing at this address', 'このアドレスには何もありません'],
  ['the body is too large', '送った内容が大きすぎます'],
  ['chunks with extensions are not known here', '拡張付きのチャンクは受け付けません'],
  ['the address is malformed', 'アドレスの形式が正しくありません'],
  ["this failed inside; the server's log says more", '内部で失敗しました。詳しくはサーバのログにあります'],
  ['this server has no page, only the addresses below /api', 'このサーバにはページがありません'],
];

const kPatterns = new SentencePatterns(kServerSentences);

/** What an answer's status means, where its sentence has no Japanese: the server's own words follow. */
const kByStatus: Record<number, string> = {
  400: '要求の内容が正しくありません',
  403: 'この操作は許可されていません',
  404: '見つかりません',
  409: '現在の状態ではできません',
  413: '大きすぎます',
  422: '記録が台帳と異なるか、破損しています',
  423: '施錠されています',
  429: '回数が多すぎます。しばらくして再試行してください',
  500: 'サーバの内部で失敗しました',
  503: '現在は応じられません。しばらくして再試行してください',
  504: '時間がかかりすぎました',
  507: 'ディスクの空きが足りません',
};

/** `sentence` of an answer with `status`, in the page's language. */
export function inOwnWords(sentence: string, status: number): string {
  if (language.peek() === 'en') return sentence;
  return kPatterns.inJapanese(sentence) ?? `${kByStatus[status] ?? '要求は受け付けられませんでした'}（${sentence}）`;
}

/** `sentence` that a program told without refusing a request: as it is, where it has no Japanese. */
export function toldInOwnWords(sentence: string): string {
  return (language.peek() === 'ja' && kPatterns.inJapanese(sentence)) || sentence;
}

/** Whether a sentence has its Japanese. */
export const hasJapanese = (sentence: string): boolean => kPatterns.inJapanese(sentence) !== undefined;
