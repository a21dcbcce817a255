// Texts of pointing, a part of those of the page.
export const pointingEn = {
  'stream.pointing': 'Pointing',
  'point.guest': '{name} (guest)',
  'point.surface': 'Point on {name}',
  'point.how': 'Hold the button down, or a finger, to point; with keys: arrows. Everybody who watches sees it, and it is recorded with the case.',
  'point.watch': 'Looking on: {names}',
  'lane.pointing': 'Pointing',
};

export const pointingJa: Record<keyof typeof pointingEn, string> = {
  'stream.pointing': '指示',
  'point.guest': '{name}（ゲスト）',
  'point.surface': '{name} の画像上を指し示す',
  'point.how': 'ボタンまたは指を押したまま動かすと指し示せます。キーでは矢印を使います。視聴者全員に見え、症例とともに記録されます。',
  'point.watch': '見学中：{names}',
  'lane.pointing': '指示',
};
