#include <algorithm>
#include <array>

#include "archive/reading/excerpt.h"
#include "base/error.h"
#include "media/export/exporter.h"
#include "viewer/api/api.h"
#include "viewer/http/handout.h"
#include "viewer/http/tar_stream.h"
#include "viewer/people/turns.h"

namespace kiroku::viewer {
namespace {

/// Each costs a disk's and a core's whole attention.
constexpr Turns::Limits kMadeAtATime{.all = 3, .of_person = 2};
constexpr Turns::Limits kTakenAtATime{.all = 12, .of_person = 3};

struct Form {
  std::string_view name, type;
};
constexpr std::array<Form, 5> kForms{{{"ts", "video/mp2t"},
                                      {"mkv", "video/x-matroska"},
                                      {"mp4", "video/mp4"},
                                      {"jsonl", "application/jsonl"},
                                      {"csv", "text/csv; charset=utf-8"}}};

const Form& form_of(const Request& request) {
  const std::string asked = request.query_text("form").value_or("mkv");
  const auto* const found = std::ranges::find(kForms, asked, &Form::name);
  if (found == kForms.end()) throw Refusal(400, "'form' is ts, mkv, mp4, jsonl or csv");
  return *found;
}

struct Stretch {
  std::int64_t from_ns = 0, to_ns = INT64_MAX;
};
Stretch stretch_of(const Request& request) {
  const Stretch stretch{request.query_integer("from_ns").value_or(0),
                        request.query_integer("to_ns").value_or(INT64_MAX)};
  if (stretch.from_ns < 0 || stretch.to_ns <= stretch.from_ns) {
    throw Refusal(400, "'from_ns' must be 0 or more and before 'to_ns'");
  }
  return stretch;
}

/// The end may lie beyond the case's: one that is recorded grows meanwhile.
void require_within(const archive::CaseReader& recording, std::int64_t from_ns) {
  try {
    recording.require_stretch({from_ns, INT64_MAX}, {"'from_ns'", std::to_string(from_ns)}, {"'to_ns'", ""});
  } catch (const UsageError& error) {
    throw Refusal(400, error.what());
  }
}

std::uint64_t sealed_bytes(const archive::CaseReader& recording, const std::vector<std::string>& streams,
                           const Stretch& stretch) {
  std::uint64_t bytes = 0;
  for (const std::string& stream : streams) {
    for (const auto& segment : recording.segments(stream, stretch.from_ns, stretch.to_ns)) {
      bytes += segment.file.bytes;
    }
  }
  return bytes;
}

class ExportApi {
 public:
  explicit ExportApi(ViewerContext& context) : context_(context), handouts_(context.home().handout_folder) {}

  Response export_stream(const Request& request) {
    const archive::CaseReader recording = context_.open_case(request);
    const auto identities = ViewerContext::require_unlocked(request);
    const std::string stream = required_stream(request);
    const archive::StreamInfo& info = recording.stream(stream);  // refuses an unknown one
    const Form& form = form_of(request);
    const Stretch stretch = stretch_of(request);
    require_within(recording, stretch.from_ns);
    const std::shared_ptr<Turns::Turn> download = begin_download(request);
    const Turns::Turn turn(turns_, request.session->person());
    const std::string name = request.parameter("case") + "-" + stream + "." + std::string(form.name);
    const auto place = handouts_.make_place(sealed_bytes(recording, {stream}, stretch));
    const bool is_entered = enter_purpose(request, "exported " + info.name);
    media::ExportOptions options;
    options.stream = stream;
    options.from_ns = stretch.from_ns;
    options.to_ns = stretch.to_ns;
    options.output = place->folder() / name;
    media::export_stream(recording, *identities, options);
    place->is_made();
    if (!is_entered) context_.enter_access(request, request.parameter("case"), "exported " + info.name);
    FileBody body = open_body(options.output);
    body.file = held_while_read(std::move(body.file), download);
    return Response::file(std::move(body), std::string(form.type)).as_download(name);
  }

  /// Everything in it stays sealed, so no identity is asked for.
  Response excerpt(const Request& request) {
    const archive::CaseReader recording = context_.open_case(request);
    const Stretch stretch = stretch_of(request);
    require_within(recording, stretch.from_ns);
    archive::ExcerptOptions options;
    options.from_ns = stretch.from_ns;
    options.to_ns = std::min(stretch.to_ns, recording.opening().begins_ns + recording.duration_ns());
    options.streams = request.query_texts("stream");
    options.made_at = utc_now();
    options.made_by = request.session->user();
    std::vector<std::string> streams = options.streams;
    if (streams.empty()) {
      for (const archive::StreamInfo& stream : recording.opening().streams) streams.push_back(stream.name);
    }
    for (const std::string& stream : streams) (void)recording.stream(stream);  // refuses an unknown one
    const std::shared_ptr<Turns::Turn> download = begin_download(request);
    const Turns::Turn turn(turns_, request.session->person());
    const std::string name = request.parameter("case") + "-excerpt";
    const auto place = handouts_.make_place(sealed_bytes(recording, streams, stretch));
    const bool is_entered = enter_purpose(request, "took an excerpt, sealed as it is");
    archive::make_excerpt(recording.folder(), options, place->folder() / name);
    place->is_made();
    if (!is_entered) {
      context_.enter_access(request, request.parameter("case"), "took an excerpt, sealed as it is");
    }
    return Response::stream(tar_stream(place->folder(), name, held_while_read(place, download)),
                            "application/x-tar")
        .as_download(name + ".tar");
  }

 private:
  /// With a purpose, a consent to it must stand, and that the case is used for it is entered before anything
  /// is made: true. Without one, the site must not demand any: false.
  bool enter_purpose(const Request& request, const std::string& what) {
    const std::optional<std::string> purpose = request.query_text("purpose");
    if (purpose) {
      context_.enter_use(request, request.parameter("case"), *purpose, what);
    } else if (context_.site_purposes().are_demanded) {
      throw Refusal(400, "this site demands a purpose of every export: say which with 'purpose'");
    }
    return purpose.has_value();
  }

  static std::string required_stream(const Request& request) {
    const auto stream = request.query_text("stream");
    if (!stream) throw Refusal(400, "'stream' is missing from the address");
    return *stream;
  }

  /// A download's, from before its file is made: it takes room on the disk until it is read or given up.
  std::shared_ptr<Turns::Turn> begin_download(const Request& request) {
    return std::make_shared<Turns::Turn>(downloads_, request.session->person());
  }
  template <typename Source>
  static std::shared_ptr<Source> held_while_read(std::shared_ptr<Source> source,
                                                 std::shared_ptr<Turns::Turn> download) {
    const auto held = std::make_shared<std::pair<std::shared_ptr<Source>, std::shared_ptr<Turns::Turn>>>(
        std::move(source), std::move(download));
    return std::shared_ptr<Source>(held, held->first.get());
  }

  ViewerContext& context_;
  Handouts handouts_;
  Turns downloads_{kTakenAtATime,
                   {"as many files are being downloaded as this disk has room for: try again in a while",
                    "three files of yours are being downloaded: try again when one of them is there"}};
  Turns turns_{kMadeAtATime,
               {"other files are being made: try again in a while",
                "two files of yours are being made: try again when one of them is there"}};
};

}  // namespace

void add_export_routes(Router& router, ViewerContext& context) {
  const auto api = std::make_shared<ExportApi>(context);
  router.add("GET", "api/cases/{case:case}/export", Right::kWatch,
             [api](const Request& request) { return api->export_stream(request); });
  router.add("GET", "api/cases/{case:case}/excerpt.tar", Right::kVerify,
             [api](const Request& request) { return api->excerpt(request); });
}

}  // namespace kiroku::viewer
