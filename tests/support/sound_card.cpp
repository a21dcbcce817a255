// The sound card of sound_card.h, as an I/O plug-in of alsa-lib ("PCM External Plugin SDK").
#include "tests/support/sound_card.h"

#include <algorithm>
#include <alsa/asoundlib.h>
#include <alsa/pcm_external.h>
#include <array>
#include <cerrno>
#include <ctime>
#include <sys/ioctl.h>

namespace {

using kiroku::test::CardFault;
using kiroku::test::SoundCardPage;

struct Card {
  snd_pcm_ioplug_t plug{};
  SoundCardPage* page = nullptr;
  std::int64_t started = 0;  // the card's count then
  std::int64_t given = 0;    // samples since
  std::int64_t held = -1;    // the count since it fell silent
  int heard = -1;            // a FIFO
  bool is_buffered = false;
  std::uint32_t noise = 1;
};

/// The next sample of the FIFO, under noise that is somewhat louder. A tenth of a second is waited for first,
/// as a sound card's buffer is: a machine that is busy writes in fits and starts.
std::int16_t next_heard(Card& card) {
  std::int16_t sample = 0;
  if (!card.is_buffered) {
    constexpr int kBuffered = 9'600;  // bytes
    int waiting = 0;
    card.is_buffered = ::ioctl(card.heard, FIONREAD, &waiting) == 0 && waiting >= kBuffered;
  }
  if (card.is_buffered && ::read(card.heard, &sample, sizeof sample) != sizeof sample) sample = 0;
  constexpr std::uint32_t kFactor = 1'664'525, kTerm = 1'013'904'223;  // D. Knuth's generator
  card.noise = card.noise * kFactor + kTerm;
  const int noise = static_cast<int>(card.noise >> 20U) - 2'048;
  return static_cast<std::int16_t>(sample / 10 + noise);
}

Card& card_of(snd_pcm_ioplug_t* plug) { return *static_cast<Card*>(plug->private_data); }

std::int64_t monotonic_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1'000'000'000LL + now.tv_nsec;
}

std::int64_t count_of(Card& card) {
  SoundCardPage& page = *card.page;
  if (page.fault == CardFault::kSilent && card.held >= 0) return card.held;
  std::int64_t count = page.taken;
  if (page.runs) {
    const double seconds = static_cast<double>(monotonic_ns() - page.plugged_ns) / 1e9;
    count = static_cast<std::int64_t>(seconds * card.plug.rate * (1 + page.wrong_by_ppm / 1e6));
  }
  const std::int64_t at_once = page.transferred_at_once;
  count = count / at_once * at_once;
  card.held = count;
  return count;
}

int start(snd_pcm_ioplug_t* plug) {
  Card& card = card_of(plug);
  if (card.page->fault == CardFault::kUnplugged) return -ENODEV;
  card.started = count_of(card);
  card.given = 0;
  return 0;
}

int stop(snd_pcm_ioplug_t* /*plug*/) { return 0; }

snd_pcm_sframes_t pointer(snd_pcm_ioplug_t* plug) {
  Card& card = card_of(plug);
  if (plug->state != SND_PCM_STATE_RUNNING) return 0;
  if (card.page->fault == CardFault::kUnplugged) {
    snd_pcm_ioplug_set_state(plug, SND_PCM_STATE_DISCONNECTED);
    return static_cast<snd_pcm_sframes_t>(card.given);
  }
  const std::int64_t since = count_of(card) - card.started;
  const bool late = since - card.given > static_cast<std::int64_t>(plug->buffer_size);
  if (late || (card.page->fault == CardFault::kOverrun && since > 0)) return -EPIPE;
  return since;
}

snd_pcm_sframes_t transfer(snd_pcm_ioplug_t* plug, const snd_pcm_channel_area_t* areas,
                           snd_pcm_uframes_t offset, snd_pcm_uframes_t size) {
  Card& card = card_of(plug);
  for (snd_pcm_uframes_t i = 0; i < size; ++i) {
    const std::int16_t sample =
        card.heard >= 0 ? next_heard(card)
                        : kiroku::test::card_sample(card.started + card.given + static_cast<std::int64_t>(i),
                                                    static_cast<int>(plug->rate));
    for (unsigned channel = 0; channel < plug->channels; ++channel) {
      const snd_pcm_channel_area_t& area = areas[channel];
      auto* const place = static_cast<char*>(area.addr) + (area.first + (offset + i) * area.step) / 8;
      std::memcpy(place, &sample, sizeof sample);
    }
  }
  card.given += static_cast<std::int64_t>(size);
  return static_cast<snd_pcm_sframes_t>(size);
}

int close_card(snd_pcm_ioplug_t* plug) {
  Card* const card = &card_of(plug);
  ::munmap(card->page, sizeof(SoundCardPage));
  if (card->heard >= 0) ::close(card->heard);
  delete card;
  return 0;
}

const snd_pcm_ioplug_callback_t kCallbacks = [] {
  snd_pcm_ioplug_callback_t callbacks{};
  callbacks.start = start;
  callbacks.stop = stop;
  callbacks.pointer = pointer;
  callbacks.transfer = transfer;
  callbacks.close = close_card;
  return callbacks;
}();

int offer(snd_pcm_ioplug_t& plug) {
  const std::array<unsigned, 1> access{SND_PCM_ACCESS_RW_INTERLEAVED}, format{SND_PCM_FORMAT_S16};
  int result = snd_pcm_ioplug_set_param_list(&plug, SND_PCM_IOPLUG_HW_ACCESS, 1, access.data());
  if (result >= 0) result = snd_pcm_ioplug_set_param_list(&plug, SND_PCM_IOPLUG_HW_FORMAT, 1, format.data());
  if (result >= 0) result = snd_pcm_ioplug_set_param_minmax(&plug, SND_PCM_IOPLUG_HW_CHANNELS, 1, 2);
  if (result >= 0) result = snd_pcm_ioplug_set_param_minmax(&plug, SND_PCM_IOPLUG_HW_RATE, 8'000, 48'000);
  if (result >= 0)
    result = snd_pcm_ioplug_set_param_minmax(&plug, SND_PCM_IOPLUG_HW_PERIOD_BYTES, 64, 64 << 10);
  if (result >= 0)
    result = snd_pcm_ioplug_set_param_minmax(&plug, SND_PCM_IOPLUG_HW_BUFFER_BYTES, 1 << 10, 1 << 20);
  return result;
}

}  // namespace

extern "C" {

SND_PCM_PLUGIN_DEFINE_FUNC(played) {
  const char *page_file = nullptr, *heard_file = nullptr;
  snd_config_iterator_t at = nullptr, next = nullptr;
  snd_config_for_each(at, next, conf) {
    snd_config_t* const entry = snd_config_iterator_entry(at);
    const char* id = nullptr;
    if (snd_config_get_id(entry, &id) >= 0 && std::strcmp(id, "page") == 0)
      snd_config_get_string(entry, &page_file);
    if (snd_config_get_id(entry, &id) >= 0 && std::strcmp(id, "heard") == 0)
      snd_config_get_string(entry, &heard_file);
  }
  if (page_file == nullptr) return -EINVAL;
  const int file = ::open(page_file, O_RDWR | O_CLOEXEC);
  if (file < 0) return -errno;
  void* const memory = ::mmap(nullptr, sizeof(SoundCardPage), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  ::close(file);
  if (memory == MAP_FAILED) return -ENOMEM;
  auto* const page = static_cast<SoundCardPage*>(memory);
  ++page->openings;
  while (page->fault == CardFault::kStuck) ::usleep(1'000);
  if (page->fault == CardFault::kUnplugged) {
    ::munmap(memory, sizeof(SoundCardPage));
    return -ENODEV;
  }
  std::int64_t unset = 0;
  page->plugged_ns.compare_exchange_strong(unset, monotonic_ns());
  auto* const card = new Card();
  card->page = page;
  if (heard_file != nullptr && *heard_file != '\0')
    card->heard = ::open(heard_file, O_RDWR | O_NONBLOCK | O_CLOEXEC);  // also for writing: it never ends
  card->plug.version = SND_PCM_IOPLUG_VERSION;
  card->plug.name = "a card that a test plays";
  card->plug.flags = SND_PCM_IOPLUG_FLAG_BOUNDARY_WA;
  card->plug.poll_fd = -1;
  card->plug.callback = &kCallbacks;
  card->plug.private_data = card;
  const int made = snd_pcm_ioplug_create(&card->plug, name, stream, mode);
  if (made < 0) {
    close_card(&card->plug);
    return made;
  }
  const int offered = offer(card->plug);
  if (offered < 0) {
    snd_pcm_ioplug_delete(&card->plug);
    return offered;
  }
  *pcmp = card->plug.pcm;
  return 0;
}

SND_PCM_PLUGIN_SYMBOL(played);
}
