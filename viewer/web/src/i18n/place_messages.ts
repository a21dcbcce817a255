// Texts of where one can work: cases, planning, a breathing lung, training; and why one of them cannot be had.
export const placeEn = {
  'place.away': 'cannot be used now',
  'place.no-right': 'The role {role} may not use: {place}.',
  'place.no-right.planning': 'Surgeons and administrators plan. Ask an administrator to give you that role, on the page “Users”.',
  'place.no-right.breathing': 'Surgeons and administrators work at the lung. Ask an administrator to give you that role, on the page “Users”.',
  'place.no-right.training': 'Ask an administrator to give you another role, on the page “Users”.',
  'place.not-running': '{place} does not run now.',
  'place.not-running.planning':
    'This page goes on by itself as soon as it runs. Whoever looks after this recorder starts it: “systemctl enable --now kiroku-planning”, or “kiroku plan serve” where Kiroku was not installed as a package.',
  'place.not-running.breathing':
    'This page goes on by itself as soon as it runs. Whoever looks after this recorder starts it for one lung: “kiroku respire serve”, with its CT, model and radiographs, or with --case for a case’s fluoroscopy.',
  'place.not-running.training':
    'This page goes on by itself as soon as it runs. Whoever looks after this recorder starts it: “systemctl enable --now kiroku-training”, or “kiroku train serve” where Kiroku was not installed as a package.',
  'place.not-installed': '{place} is not installed on this machine.',
  'place.not-installed.what': 'The program kiroku-full is missing. Whoever looks after this recorder installs the package kiroku anew.',
} as const;

export const placeJa: Record<keyof typeof placeEn, string> = {
  'place.away': '現在は使えません',
  'place.no-right': '{role}の役割では「{place}」を利用できません。',
  'place.no-right.planning': '計画できるのは外科医と管理者です。「利用者」のページで役割を変えるよう、管理者に依頼してください。',
  'place.no-right.breathing': '呼吸の作業台を使えるのは外科医と管理者です。「利用者」のページで役割を変えるよう、管理者に依頼してください。',
  'place.no-right.training': '「利用者」のページで役割を変えるよう、管理者に依頼してください。',
  'place.not-running': '「{place}」は現在動いていません。',
  'place.not-running.planning':
    '動き始めると、このページは自動的に切り替わります。記録装置の管理担当者が起動してください：「systemctl enable --now kiroku-planning」。パッケージで導入していない場合は「kiroku plan serve」。',
  'place.not-running.breathing':
    '動き始めると、このページは自動的に切り替わります。記録装置の管理担当者が、CT、モデル、X 線画像（症例の透視には --case）を指定して「kiroku respire serve」を起動してください。',
  'place.not-running.training':
    '動き始めると、このページは自動的に切り替わります。記録装置の管理担当者が起動してください：「systemctl enable --now kiroku-training」。パッケージで導入していない場合は「kiroku train serve」。',
  'place.not-installed': '「{place}」はこの機械に導入されていません。',
  'place.not-installed.what': 'プログラム kiroku-full がありません。記録装置の管理担当者がパッケージ kiroku を再度導入してください。',
};
