// Texts of written consent: what stands for a case, and what an export is for.
export const consentEn = {
  'purpose.treatment-record': 'treatment record',
  'purpose.quality-assurance': 'quality assurance',
  'purpose.teaching': 'teaching',
  'purpose.research': 'research',
  'purpose.publication': 'publication',

  'consent.title': 'Consent',
  'consent.none': 'No consent entered',
  'consent.stands': 'Consent: {purposes}',
  'consent.withdrawn': 'Withdrawn: {purposes}',
  'consent.unsigned': 'Withdrawal that nobody signed: {purposes}',
  'consent.notChecked': 'Consent could not be checked',
  'consent.since': '{purpose}: consent entered {moment}',
  'consent.withdrawnOn': '{purpose}: withdrawn {moment}',
  'consent.withdrawnUnsigned': '{purpose}: withdrawn by an entry of {moment} that nobody signed in time. Whoever writes to the disk could have made it up.',

  'export.purpose': 'Purpose',
  'export.purposeChoose': 'choose a purpose',
  'export.purposeNone': 'none named',
  'export.purposeDemanded': 'This site demands a purpose of every export: choose one.',
  'export.purposeNotGiven': 'No consent to {purpose} was given for this case.',
  'export.purposeWithdrawn': 'The consent to {purpose} was withdrawn {moment}.',
  'export.purposeUnsigned': 'An entry of {moment} withdraws the consent to {purpose}, and nobody signed that entry in time.',
  'export.purposeNotChecked': 'Whether a consent stands could not be checked: {problem}',
} as const;

export const consentJa: Record<keyof typeof consentEn, string> = {
  'purpose.treatment-record': '診療記録',
  'purpose.quality-assurance': '質の管理',
  'purpose.teaching': '教育',
  'purpose.research': '研究',
  'purpose.publication': '発表',

  'consent.title': '同意',
  'consent.none': '同意の記載なし',
  'consent.stands': '同意：{purposes}',
  'consent.withdrawn': '撤回：{purposes}',
  'consent.unsigned': '署名のない撤回：{purposes}',
  'consent.notChecked': '同意を確認できませんでした',
  'consent.since': '{purpose}：{moment} に同意を記載',
  'consent.withdrawnOn': '{purpose}：{moment} に撤回',
  'consent.withdrawnUnsigned': '{purpose}：{moment} の記載により撤回。ただし署名が間に合わず、ディスクに書き込める者が作った可能性があります。',

  'export.purpose': '目的',
  'export.purposeChoose': '目的を選択',
  'export.purposeNone': '指定なし',
  'export.purposeDemanded': 'この施設では書き出しごとに目的が必要です。目的を選んでください。',
  'export.purposeNotGiven': 'この症例には「{purpose}」への同意がありません。',
  'export.purposeWithdrawn': '「{purpose}」への同意は {moment} に撤回されました。',
  'export.purposeUnsigned': '{moment} の記載が「{purpose}」への同意を撤回していますが、その記載は署名が間に合っていません。',
  'export.purposeNotChecked': '同意が有効かどうかを確認できませんでした：{problem}',
};
