// Texts of the users.
export const usersEn = {
  'users.role': 'Role',
  'users.may': 'May',
  'users.actions': 'Actions',
  'users.locked': 'locked',
  'users.add': 'Add a user',
  'users.addDo': 'Add',
  'users.added': '{name} may sign in now.',
  'users.remove': 'Remove',
  'users.removeTitle': 'Remove {name}?',
  'users.removeWhat': 'Their sessions end at once. What they did stays in the log.',
} as const;

export const usersJa: Record<keyof typeof usersEn, string> = {
  'users.role': '役割',
  'users.may': '権限',
  'users.actions': '操作',
  'users.locked': 'ロック中',
  'users.add': '利用者を追加',
  'users.addDo': '追加',
  'users.added': '{name} がサインインできるようになりました。',
  'users.remove': '削除',
  'users.removeTitle': '{name} を削除しますか？',
  'users.removeWhat': 'そのセッションは直ちに終了します。行ったことはログに残ります。',
};
