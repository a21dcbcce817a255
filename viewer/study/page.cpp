#include "viewer/study/page.h"

namespace kiroku::study {
namespace {

constexpr std::string_view kHtml = R"page(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Reading of films</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="study.css">
<script src="study.js" defer></script>
</head>
<body>
<main id="entry">
<h1 id="title" data-word="title">Reading of films</h1>
<p data-word="intro">You will see films, one after the other, and say by points what can be judged by them. There is no right answer. Every answer is stored at once; you may pause, go back, or come again later with the same code.</p>
<form id="sign-in">
<label for="code" data-word="code">Your code</label>
<input id="code" autocomplete="off" autocapitalize="characters" spellcheck="false" required>
<button type="submit" data-word="begin">Begin</button>
</form>
<p id="refused" class="wrong" role="alert"></p>
<table class="keys">
<caption data-word="keys">Keys</caption>
<tr><th data-word="key-digits">1 to 5</th><td data-word="key-points">answers the marked question</td></tr>
<tr><th>Enter</th><td data-word="key-next">next film</td></tr>
<tr><th>Backspace</th><td data-word="key-back">film before</td></tr>
<tr><th>Space</th><td data-word="key-play">plays, stops, plays again</td></tr>
<tr><th>Z</th><td data-word="key-size">pixel for pixel, or the whole picture</td></tr>
<tr><th>P</th><td data-word="key-pause">pauses the reading</td></tr>
</table>
</main>
<main id="reading" hidden>
<header>
<span id="place" role="status"></span>
<progress id="progress" data-label="judged" max="1" value="0" aria-label="films judged"></progress>
<span id="stored" role="status"></span>
<button id="size" data-word="size" type="button" aria-pressed="false">pixel for pixel</button>
<button id="pause" data-word="pause" type="button">pause</button>
</header>
<div id="stage"><p id="waiting" role="status"></p></div>
<div id="player">
<button id="play" type="button">play again</button>
<input id="time" data-label="time" type="range" min="0" max="1000" value="0" aria-label="place in the film">
</div>
<form id="questions"></form>
<p id="problem" class="wrong" role="alert"></p>
<nav>
<button id="back" data-word="back" type="button">back</button>
<button id="next" type="button">next film</button>
</nav>
</main>
<main id="paused" hidden>
<h1 data-word="paused">Paused</h1>
<p data-word="paused-more">What was answered is stored. The window may be closed.</p>
<button id="resume" data-word="resume" type="button">go on</button>
</main>
<main id="done" hidden>
<h1 data-word="done">All films are judged</h1>
<p data-word="done-more">Thank you. Everything is stored. You may still look back, until the study is closed.</p>
<button id="look-back" data-word="look-back" type="button">back to the last film</button>
</main>
</body>
</html>
)page";

constexpr std::string_view kCss = R"page(:root { color-scheme: dark; }
* { box-sizing: border-box; }
[hidden] { display: none !important; }
html, body { height: 100%; margin: 0; }
body { background: #000; color: #c8c8c8; font: 16px/1.45 system-ui, sans-serif; }
h1 { font-size: 1.3rem; font-weight: 600; }
button, input { font: inherit; color: inherit; }
button { min-height: 2.75rem; padding: 0 1rem; background: #222; border: 1px solid #555; border-radius: 4px; cursor: pointer; }
button:disabled { color: #777; cursor: default; }
button[aria-pressed=true] { background: #444; }
:focus-visible { outline: 3px solid #f7a600; outline-offset: 2px; }
.wrong { color: #ff9d8a; margin: .25rem 0; }
.wrong:empty { display: none; }
#entry, #paused, #done { max-width: 42rem; margin: 10vh auto 0; padding: 1rem; }
#sign-in { display: flex; flex-wrap: wrap; gap: .75rem; align-items: center; margin: 1.5rem 0; }
#code { width: 12rem; min-height: 2.75rem; padding: 0 .75rem; background: #111; border: 1px solid #777; border-radius: 4px; letter-spacing: .1em; }
.keys { margin-top: 2rem; color: #aaa; border-collapse: collapse; }
.keys caption { text-align: left; padding-bottom: .25rem; }
.keys th { text-align: left; font-weight: 600; padding-right: 1.5rem; }
#reading { height: 100vh; height: 100dvh; display: flex; flex-direction: column; padding: .5rem .75rem; gap: .5rem; }
#reading header { display: flex; flex-wrap: wrap; gap: .5rem 1rem; align-items: center; }
#reading header progress { flex: 1; min-width: 6rem; height: .4rem; appearance: none; background: #333; border: 0; }
progress::-webkit-progress-bar { background: #333; }
progress::-webkit-progress-value { background: #888; }
progress::-moz-progress-bar { background: #888; }
#reading header button { min-height: 2.25rem; }
#stored { color: #999; min-width: 5rem; }
#stage { flex: 1; min-height: 0; display: flex; align-items: center; justify-content: center; overflow: hidden; }
#stage video { display: block; width: 100%; height: 100%; object-fit: contain; }
#stage.exact { display: block; overflow: auto; scrollbar-color: #555 #111; }
#stage.exact video { width: auto; height: auto; margin: auto; object-fit: fill; }
#player { display: flex; gap: .75rem; align-items: center; }
#player button { min-height: 2.25rem; min-width: 7.5rem; }
#time { flex: 1; height: .4rem; appearance: none; background: #444; border-radius: .2rem; }
#time::-webkit-slider-thumb { appearance: none; width: 1.1rem; height: 1.1rem; background: #aaa; border-radius: 50%; }
#time::-moz-range-thumb { width: 1.1rem; height: 1.1rem; background: #aaa; border: 0; border-radius: 50%; }
#questions { display: flex; flex-direction: column; gap: .35rem; }
fieldset { display: flex; flex-wrap: wrap; gap: .35rem .5rem; align-items: center; margin: 0; padding: .25rem .5rem; border: 0; border-left: 4px solid #333; }
fieldset.asked { border-left-color: #f7a600; }
legend { float: left; padding: 0; flex: 1 1 20rem; }
fieldset label { position: relative; display: flex; align-items: center; justify-content: center; min-height: 2.75rem; flex: 0 1 9.5rem; padding: 0 .6rem; background: #161616; border: 1px solid #444; border-radius: 4px; text-align: center; cursor: pointer; }
fieldset label b { margin-right: .5rem; color: #fff; }
fieldset input { position: absolute; opacity: 0; inset: 0; margin: 0; cursor: pointer; }
fieldset label:has(:checked) { background: #2b4a6b; border-color: #7fb2e5; color: #fff; }
fieldset label:has(:focus-visible) { outline: 3px solid #f7a600; outline-offset: 1px; }
#reading nav { display: flex; justify-content: space-between; }
#reading nav button { min-width: 9rem; }
@media (max-height: 44rem) { legend { flex-basis: 14rem; font-size: .95rem; } fieldset label { min-height: 2.25rem; flex-basis: 8rem; font-size: .9rem; } #reading { gap: .25rem; } }
)page";

constexpr std::string_view kJs = R"page('use strict';
const $ = (id) => document.getElementById(id);
const kKept = 3;  // films in memory
// What the page says in the browser's language; questions and points are the study's own.
const kJapanese = {
  title: '動画の評価', intro: '動画を一つずつ見て、それで何が判断できるかを点数で答えてください。正解はありません。答えはそのつど保存されます。休むことも、前に戻ることも、同じコードで後から続けることもできます。',
  code: 'コード', begin: '始める', keys: 'キー', 'key-digits': '1から5', 'key-points': '印の付いた質問に答える', 'key-next': '次の動画', 'key-back': '前の動画', 'key-play': '再生、停止、もう一度再生', 'key-size': '等倍、または全体', 'key-pause': '評価を休む',
  size: '等倍', pause: '休む', back: '戻る', resume: '続ける', 'look-back': '最後の動画に戻る', next: '次の動画', finish: '終わる',
  paused: '休憩中', 'paused-more': '答えは保存されています。ウィンドウを閉じてもかまいません。', done: 'すべての動画を評価しました', 'done-more': 'ありがとうございました。すべて保存されています。研究が締め切られるまでは見直せます。',
  place: '動画 {0} / {1}', play: '再生', stop: '停止', again: 'もう一度', storing: '保存中', stored: '保存済み', waiting: '動画を読み込んでいます。',
  'not-stored': '最後の答えは保存されていません: {0} Enterキーでもう一度試してください。', unplayable: 'このブラウザでは動画を再生できません: {0}。評価せず、研究の担当者に伝えてください。', unfetched: '動画を読み込めませんでした', judged: '評価した動画', time: '動画の位置', 'no-reader': 'このコードの評価者はいません。',
};
const kEnglish = {
  next: 'next film', finish: 'finish', place: 'Film {0} of {1}', play: 'play', stop: 'stop', again: 'play again', storing: 'storing', stored: 'stored', waiting: 'The film is fetched.',
  'not-stored': 'The last answer is not stored: {0} Press Enter to try again.', unplayable: 'This browser cannot play the film: {0}. Do not judge it; tell who runs the reading.', unfetched: 'the film could not be fetched', 'no-reader': 'There is no reader with this code.',
};
const japanese = /^ja\b/.test(navigator.language);
function say(word, ...values) {
  const text = japanese ? kJapanese[word] : kEnglish[word];
  return values.reduce((all, value, i) => all.replace('{' + i + '}', value), text);
}
if (japanese) {
  document.documentElement.lang = 'ja';
  document.title = kJapanese.title;
  for (const element of document.querySelectorAll('[data-label]')) element.setAttribute('aria-label', kJapanese[element.dataset.label]);
  for (const element of document.querySelectorAll('[data-word]')) element.textContent = kJapanese[element.dataset.word];
}

let code = '', study = null, at = 0, asked = 0, exact = false;
let video = null, seen = null, changed = false;
const films = new Map();  // of places: promises of addresses
let storing = Promise.resolve();

async function ask(path, body) {
  const answer = await fetch(path, { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(body) });
  const said = await answer.json();
  if (!answer.ok) throw new Error(said.error);
  return said;
}
function show(id) {
  for (const main of document.querySelectorAll('main')) main.hidden = main.id !== id;
}

// Films are fetched whole before they are shown, so that nothing but the computer itself decides how they run.
function film(place) {
  if (!films.has(place)) {
    const got = fetch('films/' + study.showings[place].token).then(async (answer) => {
      if (!answer.ok) throw new Error(say('unfetched'));
      return URL.createObjectURL(await answer.blob());
    });
    got.catch(() => films.delete(place));
    films.set(place, got);
    for (const [old, address] of films) {
      if (films.size <= kKept) break;
      if (old === at || old === place) continue;
      films.delete(old);
      address.then(URL.revokeObjectURL, () => {});
    }
  }
  return films.get(place);
}
function fetchAhead() {
  if (at + 1 < study.showings.length) film(at + 1).catch(() => {});
}

function count() {
  const now = video?.getVideoPlaybackQuality?.();
  return { plays: seen.plays, pictures: now?.totalVideoFrames ?? 0, dropped: now?.droppedVideoFrames ?? 0 };
}
// Answers go one after the other, in the order in which they were given.
function store() {
  const showing = study.showings[at];
  const said = { code, showing: showing.token, points: [...showing.points], ...count() };
  changed = false;
  $('stored').textContent = say('storing');
  storing = storing.catch(() => {}).then(() => ask('answer', said));
  const mine = storing;
  mine.then(
    () => {
      if (mine === storing) { $('stored').textContent = say('stored'); $('problem').textContent = ''; }
    },
    (error) => {
      changed = true;
      $('stored').textContent = '';
      $('problem').textContent = say('not-stored', error.message);
    },
  );
  return mine;
}

const whole = (showing) => showing.points.every((one) => one > 0);
function draw() {
  const done = study.showings.filter(whole).length, all = study.showings.length;
  $('place').textContent = say('place', at + 1, all);
  $('progress').value = done / all;
  $('back').disabled = at === 0;
  $('next').disabled = !whole(study.showings[at]);
  $('next').textContent = say(at + 1 === all ? 'finish' : 'next');
  const points = study.showings[at].points;
  document.querySelectorAll('fieldset').forEach((field, question) => {
    field.classList.toggle('asked', question === asked);
    field.querySelectorAll('input').forEach((input, i) => { input.checked = points[question] === i + 1; });
  });
}
function give(question, points) {
  study.showings[at].points[question] = points;
  const open = study.showings[at].points.findIndex((one) => one === 0);
  asked = open >= 0 ? open : Math.min(question + 1, study.questions.length - 1);
  draw();
  store().catch(() => {});
  fetchAhead();
}
function askQuestions() {
  $('questions').replaceChildren(...study.questions.map((text, question) => {
    const field = document.createElement('fieldset');
    field.append(Object.assign(document.createElement('legend'), { textContent: text }));
    study.points.forEach((word, i) => {
      const label = document.createElement('label');
      const input = Object.assign(document.createElement('input'), { type: 'radio', name: 'question' + question, value: String(i + 1) });
      input.addEventListener('change', () => give(question, i + 1));
      label.append(input, Object.assign(document.createElement('b'), { textContent: String(i + 1) }), word);
      field.append(label);
    });
    field.addEventListener('focusin', () => { asked = question; draw(); });
    return field;
  }));
}

function size() {
  $('stage').classList.toggle('exact', exact);
  $('size').setAttribute('aria-pressed', String(exact));
  if (!video) return;
  video.style.width = exact ? video.videoWidth / devicePixelRatio + 'px' : '';
  video.style.height = exact ? video.videoHeight / devicePixelRatio + 'px' : '';
}
function drawPlayer() {
  $('play').textContent = say(!video || video.ended ? 'again' : video.paused ? 'play' : 'stop');
  if (video && video.duration > 0) $('time').value = String(Math.round(1000 * video.currentTime / video.duration));
}
function play() {
  if (!video) return;
  if (!video.paused && !video.ended) video.pause();
  else video.play().catch(() => {});
}
async function open(place) {
  at = place;
  seen = { plays: 0 };
  changed = false;
  const unanswered = study.showings[at].points.findIndex((one) => one === 0);
  asked = Math.max(0, unanswered);
  $('stored').textContent = '';
  $('problem').textContent = '';
  // A new element: what it counts is of this film alone.
  video?.pause();
  video = null;
  $('stage').replaceChildren(Object.assign(document.createElement('p'), { id: 'waiting', textContent: say('waiting') }));
  show('reading');
  draw();
  drawPlayer();
  try {
    const address = await film(place);
    if (place !== at) return;
    const made = document.createElement('video');
    made.muted = true;
    made.playsInline = true;
    made.disablePictureInPicture = true;
    made.disableRemotePlayback = true;
    made.addEventListener('contextmenu', (event) => event.preventDefault());
    made.addEventListener('loadedmetadata', size);
    made.addEventListener('ended', () => { ++seen.plays; changed = true; fetchAhead(); });
    for (const name of ['play', 'pause', 'ended', 'timeupdate', 'seeked']) made.addEventListener(name, drawPlayer);
    made.addEventListener('error', () => { $('problem').textContent = say('unplayable', made.error?.message ?? '?'); });
    made.src = address;
    video = made;
    $('stage').replaceChildren(made);
    if (!$('reading').hidden) await made.play().catch(() => {});
  } catch (error) {
    if (place === at) $('stage').replaceChildren(Object.assign(document.createElement('p'), { className: 'wrong', textContent: error.message }));
  }
}

async function go(place) {
  if (place < 0) return;
  if (place > at && !whole(study.showings[at])) return;
  try {
    if (changed && study.showings[at].points.some((one) => one > 0)) await store();
    else await storing;
  } catch {
    return;
  }
  if (place < study.showings.length) return open(place);
  const open_ = study.showings.findIndex((one) => !whole(one));
  if (open_ >= 0) return open(open_);
  video?.pause();
  show('done');
}
function pause() {
  video?.pause();
  show('paused');
  $('resume').focus();
}
function resume() {
  show('reading');
  if (video && !video.ended) video.play().catch(() => {});
}

$('sign-in').addEventListener('submit', async (event) => {
  event.preventDefault();
  $('refused').textContent = '';
  try {
    code = $('code').value.trim();
    study = await ask('begin', { code });
    if (study.title) document.title = $('title').textContent = study.title;
    askQuestions();
    const first = study.showings.findIndex((one) => !whole(one));
    $('code').blur();
    if (first >= 0) await open(first);
    else { at = study.showings.length - 1; show('done'); }
  } catch (error) {
    $('refused').textContent = error.message === kEnglish['no-reader'] ? say('no-reader') : error.message;
  }
});
$('questions').addEventListener('submit', (event) => event.preventDefault());
$('next').addEventListener('click', () => go(at + 1));
$('back').addEventListener('click', () => go(at - 1));
$('pause').addEventListener('click', pause);
$('resume').addEventListener('click', resume);
$('look-back').addEventListener('click', () => open(study.showings.length - 1));
$('play').addEventListener('click', play);
$('size').addEventListener('click', () => { exact = !exact; size(); });
$('time').addEventListener('input', () => {
  if (!video || !(video.duration > 0)) return;
  video.pause();
  video.currentTime = Number($('time').value) / 1000 * video.duration;
});
document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !study) return;
  if (!$('paused').hidden) {
    if (event.key === 'p' || event.key === 'P') { event.preventDefault(); resume(); }
    return;
  }
  if ($('reading').hidden) return;
  const onButton = event.target instanceof HTMLButtonElement;
  if (event.key >= '1' && event.key <= '5' && event.key.length === 1) give(asked, Number(event.key));
  else if (event.key === 'Enter' && !onButton) go(at + 1);
  else if (event.key === 'Backspace') go(at - 1);
  else if (event.key === ' ' && !onButton) play();
  else if (event.key === 'z' || event.key === 'Z') { exact = !exact; size(); }
  else if (event.key === 'p' || event.key === 'P') pause();
  else return;
  event.preventDefault();
});
addEventListener('beforeunload', (event) => {
  if (study && changed && $('problem').textContent !== '') event.preventDefault();
});
)page";

}  // namespace

std::string_view page_html() { return kHtml; }
std::string_view page_css() { return kCss; }
std::string_view page_js() { return kJs; }

}  // namespace kiroku::study
