#include "viewer/study/desk.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <string_view>
#include <sys/stat.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "base/ascii.h"
#include "base/error.h"
#include "base/foreign_json.h"
#include "crypto/hash.h"
#include "viewer/study/closing.h"
#include "viewer/study/page.h"

namespace kiroku::study {
namespace {

using nlohmann::ordered_json;

/// Nothing of the page comes from elsewhere; films are what it fetched itself (blob:).
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; media-src blob:; img-src "
    "data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

http::Response respond(int status, const char* type, http::Body body) {
  return {status,
          {{"Content-Type", type},
           {"Content-Security-Policy", kPolicy},
           {"X-Content-Type-Options", "nosniff"},
           {"Referrer-Policy", "no-referrer"},
           {"Cross-Origin-Resource-Policy", "same-origin"},
           {"Cache-Control", "no-store"}},
          std::move(body)};
}

http::Response respond_json(int status, const ordered_json& json) {
  return respond(status, "application/json",
                 json.dump(-1, ' ', false, ordered_json::error_handler_t::replace));
}

http::Response respond_error(int status, const std::string& why) {
  return respond_json(status, {{"error", why}});
}

/// "127.0.0.1:8450" and the like: a name that somebody else gave this machine's address is another site.
bool is_this_machine(std::string_view host) {
  const std::size_t colon = host.rfind(':');
  if (colon != std::string_view::npos && host.find(']', colon) == std::string_view::npos)
    host = host.substr(0, colon);
  return host == "127.0.0.1" || host == "[::1]" || same_but_for_case(host, "localhost");
}

/// Why a request did not come from the page, or "".
std::string foreign(const http::Request& request) {
  const std::string_view host = request.field("Host");
  if (!is_this_machine(host)) return "the films are shown on the computer itself alone";
  const std::string_view origin = request.field("Origin");
  if (!origin.empty() && origin != "http://" + std::string(host)) return "another site asked for this";
  const std::string_view site = request.field("Sec-Fetch-Site");
  if (!site.empty() && site != "same-origin" && site != "none") return "another site asked for this";
  return {};
}

std::uint64_t counted(const ordered_json& json, const char* name) {
  const auto found = json.find(name);
  return found != json.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
}

/// A field of text; "" where there is none.
std::string worded(const ordered_json& json, const char* name) {
  const auto found = json.find(name);
  return found != json.end() && found->is_string() ? found->get<std::string>() : "";
}

/// Whether the open file has the bytes of the film with which the study was made.
bool holds(const Descriptor& file, const Film& film) {
  struct stat status {};
  if (::fstat(file.number(), &status) != 0 || !S_ISREG(status.st_mode) ||
      static_cast<std::uint64_t>(status.st_size) != film.bytes)
    return false;
  constexpr std::size_t kPiece = std::size_t{1} << 20U;
  Bytes piece(kPiece);
  crypto::Sha256 hash;
  for (std::uint64_t done = 0; done < film.bytes;) {
    const ssize_t read = ::pread(file.number(), piece.data(), piece.size(), static_cast<off_t>(done));
    if (read <= 0) return false;
    hash.update(ByteView(piece).first(static_cast<std::size_t>(read)));
    done += static_cast<std::uint64_t>(read);
  }
  return hash.finish() == film.sha256;
}

}  // namespace

Desk::Desk(archive::FileSystem& files, std::filesystem::path folder, const Clock& clock)
    : folder_(std::move(folder)), clock_(clock), study_(read_study(folder_)) {
  if (is_closed(folder_)) {
    throw UsageError(folder_.string() +
                     " is closed: nothing is answered any more; 'kiroku quality study report' says what came "
                     "of it");
  }
  held_ = hold_study(files, folder_);
  for (std::size_t reader = 1; reader <= study_.study.readers.size(); ++reader) {
    books_.push_back(std::make_unique<AnswerBook>(files, folder_, study_, reader));
    for (const Showing& showing : study_.study.readers[reader - 1].showings)
      films_.emplace(showing.token, showing.film);
  }
}

Desk::~Desk() = default;

http::Response Desk::refuse(const http::Refusal& refusal) {
  return respond_error(refusal.status, refusal.why);
}

http::Response Desk::answer(const http::Request& request) {
  if (const std::string why = foreign(request); !why.empty()) return respond_error(403, why);
  const bool reads = request.method == "GET" || request.method == "HEAD";
  constexpr std::string_view kFilms = "/films/";
  if (reads && request.target == "/")
    return respond(200, "text/html; charset=utf-8", std::string(page_html()));
  if (reads && request.target == "/study.css")
    return respond(200, "text/css; charset=utf-8", std::string(page_css()));
  if (reads && request.target == "/study.js")
    return respond(200, "text/javascript; charset=utf-8", std::string(page_js()));
  if (reads && request.target.starts_with(kFilms)) return film(request.target.substr(kFilms.size()));
  if (request.method == "POST" && (request.target == "/begin" || request.target == "/answer")) {
    // What another site may send without being asked first is of other types.
    if (!same_but_for_case(request.field("Content-Type"), "application/json"))
      return respond_error(415, "say it as application/json");
    return request.target == "/begin" ? begin(request) : store(request);
  }
  return respond_error(404, "there is nothing at this address");
}

std::size_t Desk::reader_of(const std::string& code) const {
  const auto plain = [](std::string_view text) {
    std::string kept;
    for (const char c : text) {
      if (c != '-' && c != ' ') kept += ascii_upper(c);
    }
    return kept;
  };
  const std::string asked = plain(code);
  for (std::size_t i = 0; i < study_.study.readers.size(); ++i) {
    if (!asked.empty() && plain(study_.study.readers[i].code) == asked) return i + 1;
  }
  return 0;
}

http::Response Desk::begin(const http::Request& request) {
  const auto json = parse_foreign_json<ordered_json>(request.body);
  const std::size_t reader = json.is_object() ? reader_of(worded(json, "code")) : 0;
  if (reader == 0) return respond_error(403, "There is no reader with this code.");
  ordered_json showings = ordered_json::array();
  {
    const std::lock_guard guard(mutex_);
    const NewestAnswers& newest = books_[reader - 1]->newest();
    for (const Showing& showing : study_.study.readers[reader - 1].showings) {
      const auto found = newest.find(showing.token);
      showings.push_back(
          {{"token", showing.token},
           {"points", found == newest.end() ? std::vector<int>(study_.study.questions.size(), 0)
                                            : found->second.points}});
    }
  }
  return respond_json(200, {{"title", study_.study.title},
                            {"reader", reader},
                            {"questions", study_.study.questions},
                            {"points", study_.study.points},
                            {"showings", std::move(showings)}});
}

http::Response Desk::store(const http::Request& request) {
  const auto json = parse_foreign_json<ordered_json>(request.body);
  const std::size_t reader = json.is_object() ? reader_of(worded(json, "code")) : 0;
  if (reader == 0) return respond_error(403, "There is no reader with this code.");
  Answer answer;
  answer.showing = worded(json, "showing");
  const auto& showings = study_.study.readers[reader - 1].showings;
  if (std::ranges::find(showings, answer.showing, &Showing::token) == showings.end())
    return respond_error(404, "This reader was not shown this film.");
  const auto points = json.find("points");
  bool fits = points != json.end() && points->is_array() && points->size() == study_.study.questions.size();
  if (fits) {
    for (const ordered_json& one : *points) {
      fits = fits && one.is_number_unsigned() && one.get<std::uint64_t>() <= kPoints;
      if (fits) answer.points.push_back(one.get<int>());
    }
  }
  if (!fits) return respond_error(400, "Points are from 1 to 5, one for each question, 0 for none yet.");
  answer.seen = {counted(json, "plays"), counted(json, "pictures"), counted(json, "dropped")};
  answer.utc = clock_.utc();
  const std::lock_guard guard(mutex_);
  AnswerBook& book = *books_[reader - 1];
  try {
    book.add(answer);
  } catch (const Error& error) {
    return respond_error(500, error.what());
  }
  return respond_json(200, {{"stored", book.lines()}});
}

http::Response Desk::film(const std::string& token) const {
  const auto found = films_.find(token);
  if (found == films_.end()) return respond_error(404, "there is no such film");
  const std::filesystem::path file = folder_ / kFilmsFolder / found->second;
  const auto opened = std::make_shared<const Descriptor>(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (!*opened) throw IoError("open", file, errno);
  const auto& films = study_.study.films;
  const auto made = std::ranges::find(films, found->second, &Film::name);
  // Days may lie between the start of this program and a reader's visit.
  if (made == films.end() || !holds(*opened, *made))
    return respond_error(500,
                         "this is not the film of the study: whoever keeps the study should look into it");
  return respond(200, "video/mp4", http::FileBody{opened, 0, made->bytes});
}

}  // namespace kiroku::study
