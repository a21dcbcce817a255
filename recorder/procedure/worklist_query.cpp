// The DICOM side of a worklist: one association, one C-FIND. The only file that knows DCMTK.
#include <array>
#include <ctime>
#include <mutex>

#include "dcmtk/config/osconfig.h"
#include "dcmtk/dcmdata/dctk.h"
#include "dcmtk/dcmnet/scu.h"
#include "dcmtk/oflog/oflog.h"
#include "recorder/procedure/worklist_box.h"
#include "recorder/vitals/hl7_charset.h"

namespace kiroku::recorder {
namespace {

/// DCMTK would write to standard error, and what it writes may hold a patient's name.
void silence_dcmtk() {
  static std::once_flag once;
  std::call_once(once, [] { OFLog::configure(OFLogger::OFF_LOG_LEVEL); });
}

/// Asks once, and takes no more answers than are kept.
class Query : public DcmSCU {
 public:
  [[nodiscard]] bool cut() const { return cut_; }

 protected:
  OFCondition handleFINDResponse(const T_ASC_PresentationContextID context, QRResponse* response,
                                 OFBool& wait_for_next) override {
    const OFCondition result = DcmSCU::handleFINDResponse(context, response, wait_for_next);
    if (++answers_ > kMostWorklistItems) {
      cut_ = true;
      wait_for_next = OFFalse;
    }
    return result;
  }

 private:
  std::size_t answers_ = 0;
  bool cut_ = false;
};

std::tm local_time(UtcTime time) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(
      std::chrono::time_point_cast<std::chrono::system_clock::duration>(time));
  std::tm here{};
  localtime_r(&seconds, &here);
  return here;
}

std::string local_day(UtcTime time) {
  const std::tm here = local_time(time);
  std::array<char, 16> text{};
  std::strftime(text.data(), text.size(), "%Y%m%d", &here);
  return text.data();
}

/// Empty attributes are asked for, others are matched (PS3.4 table K.6-1).
void fill_question(DcmDataset& question, const WorklistOptions& options, UtcTime now) {
  for (const DcmTagKey& key :
       {DCM_SpecificCharacterSet, DCM_TimezoneOffsetFromUTC, DCM_AccessionNumber, DCM_ReferringPhysicianName,
        DCM_PatientName, DCM_PatientID, DCM_IssuerOfPatientID, DCM_PatientBirthDate, DCM_PatientSex,
        DCM_AdmissionID, DCM_StudyInstanceUID, DCM_RequestingPhysician, DCM_RequestedProcedureDescription,
        DCM_RequestedProcedureID}) {
    question.insertEmptyElement(key);
  }
  DcmItem* code = nullptr;
  question.findOrCreateSequenceItem(DCM_RequestedProcedureCodeSequence, code);
  DcmItem* step = nullptr;
  question.findOrCreateSequenceItem(DCM_ScheduledProcedureStepSequence, step);
  DcmItem* protocol = nullptr;
  step->findOrCreateSequenceItem(DCM_ScheduledProtocolCodeSequence, protocol);
  for (DcmItem* item : {code, protocol}) {
    for (const DcmTagKey& key : {DCM_CodeValue, DCM_CodingSchemeDesignator, DCM_CodeMeaning}) {
      item->insertEmptyElement(key);
    }
  }
  for (const DcmTagKey& key : {DCM_ScheduledProcedureStepStartTime, DCM_ScheduledPerformingPhysicianName,
                               DCM_ScheduledProcedureStepDescription, DCM_ScheduledProcedureStepID,
                               DCM_ScheduledStationName, DCM_ScheduledProcedureStepLocation}) {
    step->insertEmptyElement(key);
  }
  step->putAndInsertString(DCM_Modality, options.modality.c_str());
  step->putAndInsertString(DCM_ScheduledStationAETitle, options.station_ae.c_str());
  const auto window = std::chrono::duration_cast<UtcTime::duration>(options.window);
  const std::string first = local_day(now - window), last = local_day(now + window);
  step->putAndInsertString(DCM_ScheduledProcedureStepStartDate, (first + "-" + last).c_str());
}

/// All of an attribute; "" where it is absent.
std::string text(DcmItem* item, const DcmTagKey& key) {
  OFString value;
  if (item == nullptr || item->findAndGetOFStringArray(key, value).bad()) return "";
  std::string result(value.c_str(), value.length());
  result.erase(result.find_last_not_of(std::string("\0 ", 2)) + 1);
  return result;
}

DcmItem* first_item(DcmItem* of, const DcmTagKey& sequence) {
  DcmItem* item = nullptr;
  if (of != nullptr) of->findAndGetSequenceItem(sequence, item);
  return item;
}

/// A PN (PS3.5 6.2.1): the alphabetic group's family, given and middle name.
PersonName person(const std::string& as_sent) {
  PersonName name;
  name.as_sent = as_sent;
  const std::string alphabetic = as_sent.substr(0, as_sent.find('='));
  std::array<std::string, 3> parts;
  std::size_t begin = 0;
  for (std::string& part : parts) {
    const std::size_t end = alphabetic.find('^', begin);
    part = alphabetic.substr(begin, end == std::string::npos ? end : end - begin);
    if (end == std::string::npos) break;
    begin = end + 1;
  }
  name.family = parts[0];
  name.given = parts[1] + (parts[1].empty() || parts[2].empty() ? "" : " ") + parts[2];
  return name;
}

/// ±HHMM of (0008,0201): from -1200 to +1400.
std::optional<std::chrono::minutes> stated_zone(const std::string& offset) {
  if (offset.size() != 5 || (offset[0] != '+' && offset[0] != '-') ||
      offset.find_first_not_of("0123456789", 1) != std::string::npos) {
    return {};
  }
  constexpr int kMostMinutes = 59;
  const int minutes = std::stoi(offset.substr(3));
  const auto zone = std::chrono::hours(std::stoi(offset.substr(1, 2))) + std::chrono::minutes(minutes);
  if (minutes > kMostMinutes || zone > std::chrono::hours(offset[0] == '-' ? 12 : 14)) return {};
  return offset[0] == '-' ? -zone : zone;
}

/// The digits of "20260805" and of "2026.08.05", as ACR-NEMA wrote it; "" for anything else.
std::string plain_date(const std::string& date) {
  std::string plain = date;
  if (date.size() == 10 && date[4] == '.' && date[7] == '.')
    plain = date.substr(0, 4) + date.substr(5, 2) + date.substr(8);
  return plain.size() == 8 && plain.find_first_not_of("0123456789") == std::string::npos ? plain : "";
}

/// HH, HHMM or HHMMSS of a time with or without a fraction, or as ACR-NEMA wrote it ("12:36:26"); "" for
/// anything else.
std::string plain_time(const std::string& time) {
  constexpr std::size_t kLongestFraction = 6;
  constexpr std::string_view kDigits = "0123456789";
  const std::size_t dot = std::min(time.find('.'), time.size());
  std::string plain = time.substr(0, dot);
  const std::string fraction = dot == time.size() ? "" : time.substr(dot + 1);
  const bool has_colons =
      (plain.size() == 5 || plain.size() == 8) && plain[2] == ':' && (plain.size() == 5 || plain[5] == ':');
  if (has_colons) std::erase(plain, ':');
  const bool is_one = (plain.size() == 2 || plain.size() == 4 || plain.size() == 6) &&
                      plain.find_first_not_of(kDigits) == std::string::npos &&
                      fraction.find_first_not_of(kDigits) == std::string::npos;
  const bool is_fraction =
      dot == time.size() || (plain.size() == 6 && !fraction.empty() && fraction.size() <= kLongestFraction);
  if (!is_one || !is_fraction) return "";
  const auto below = [&plain](std::size_t at, int bound) {
    return at >= plain.size() || std::stoi(plain.substr(at, 2)) < bound;
  };
  return below(0, 24) && below(2, 60) && below(4, 61) ? plain : "";
}

/// A moment of this machine's clocks.
std::optional<UtcTime> local_moment(const std::chrono::year_month_day& on, int hour, int minute, int second) {
  std::tm here{};
  here.tm_year = static_cast<int>(on.year()) - 1900;
  here.tm_mon = static_cast<int>(static_cast<unsigned>(on.month())) - 1;
  here.tm_mday = static_cast<int>(static_cast<unsigned>(on.day()));
  here.tm_hour = hour;
  here.tm_min = minute;
  here.tm_sec = second;
  here.tm_isdst = -1;
  const std::time_t seconds = std::mktime(&here);
  if (seconds == -1) return {};
  return UtcTime(std::chrono::seconds(seconds));
}

/// When DA and TM (HH[MM[SS[.F…]]]) of a step plan it, by the zone that it states; where that cannot be read,
/// within which time, if the day can.
void take_moment(WorklistItem& item, const std::string& date, const std::string& time,
                 const std::string& zone) {
  constexpr std::chrono::hours kDay{24}, kFarthestZone{14};
  const std::string day = plain_date(date), clock = plain_time(time);
  if (day.empty()) return;
  const auto part = [](const std::string& of, std::size_t from, std::size_t count) {
    return from < of.size() ? std::stoi(of.substr(from, count)) : 0;
  };
  const std::chrono::year_month_day on{std::chrono::year(part(day, 0, 4)),
                                       std::chrono::month(static_cast<unsigned>(part(day, 4, 2))),
                                       std::chrono::day(static_cast<unsigned>(part(day, 6, 2)))};
  if (!on.ok()) return;
  const UtcTime begin{std::chrono::sys_days(on)};
  const auto since = std::chrono::hours(part(clock, 0, 2)) + std::chrono::minutes(part(clock, 2, 2)) +
                     std::chrono::seconds(part(clock, 4, 2));
  const auto offset = stated_zone(zone);
  if (!zone.empty() && !offset) {
    const UtcTime first = begin + (clock.empty() ? std::chrono::seconds(0) : since);
    item.within = TimeSpan{first - kFarthestZone, (clock.empty() ? first + kDay : first) + kFarthestZone};
  } else if (clock.empty()) {
    const auto midnight = offset ? std::optional(begin - *offset) : local_moment(on, 0, 0, 0);
    if (midnight) item.within = TimeSpan{*midnight, *midnight + kDay};
  } else if (offset) {
    item.planned = begin + since - *offset;
  } else {
    item.planned = local_moment(on, part(clock, 0, 2), part(clock, 2, 2), part(clock, 4, 2));
  }
}

/// "2026-08-05T09:15" of a date and a time, for people.
std::string planned_text(const std::string& date, const std::string& time) {
  std::string result = iso_date(date);
  for (std::size_t i = 0; !result.empty() && i < 6 && i + 2 <= time.size() && time[i] != '.'; i += 2) {
    result += (i == 0 ? "T" : ":") + time.substr(i, 2);
  }
  return result;
}

void take_code(ProcedureData& data, DcmItem* code) {
  if (code == nullptr || !data.code.empty()) return;
  data.code = text(code, DCM_CodeValue);
  data.coding_system = text(code, DCM_CodingSchemeDesignator);
  if (data.description.empty()) data.description = text(code, DCM_CodeMeaning);
}

/// The values of Specific Character Set (PS3.3 C.12.1.1.2), without the "2022" that only says that there may
/// be others: "ISO 2022 IR 87" is "ISO IR 87", as HL7 calls it.
std::vector<std::string> character_sets(DcmDataset& answer) {
  constexpr std::string_view kSwitching = "ISO 2022";
  std::vector<std::string> sets;
  std::string rest = text(&answer, DCM_SpecificCharacterSet);
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\\'), rest.size());
    std::string one = rest.substr(0, end);
    if (one.starts_with(kSwitching)) one.replace(0, kSwitching.size(), "ISO");
    sets.push_back(std::move(one));
    rest.erase(0, end + 1);
  }
  return sets;
}

/// Whether the step is of the station and the modality that were asked for. Both must be returned (PS3.4
/// table K.6-1, type 1): a step that does not say is nobody's.
bool is_asked_for(DcmDataset& answer, const WorklistOptions& options) {
  DcmItem* const step = first_item(&answer, DCM_ScheduledProcedureStepSequence);
  const auto names = [step](const DcmTagKey& key, const std::string& wanted) {
    if (wanted.empty()) return true;
    std::string rest = text(step, key);
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find('\\'), rest.size());
      std::string one = rest.substr(0, end);
      one.erase(0, one.find_first_not_of(' '));
      one.erase(one.find_last_not_of(' ') + 1);
      if (one == wanted) return true;
      rest.erase(0, end + 1);
    }
    return false;
  };
  return names(DCM_ScheduledStationAETitle, options.station_ae) && names(DCM_Modality, options.modality);
}

WorklistItem read_item(DcmDataset& answer) {
  // DCMTK converts what it can; it cannot switch between sets (ISO 2022, Japanese) with glibc's iconv.
  std::vector<std::string> sets = character_sets(answer);
  if (answer.convertToUTF8().good()) sets = {"UNICODE UTF-8"};
  const auto words = [&sets](DcmItem* item, const DcmTagKey& key) {
    return hl7_text_as_utf8(text(item, key), sets).text;
  };
  WorklistItem item;
  ProcedureData& data = item.data;
  data.origin = "worklist";
  data.patient_id = words(&answer, DCM_PatientID);
  data.patient_id_issuer = words(&answer, DCM_IssuerOfPatientID);
  data.patient = person(words(&answer, DCM_PatientName));
  data.birth_date = iso_date(text(&answer, DCM_PatientBirthDate));
  data.sex = text(&answer, DCM_PatientSex);
  data.visit = words(&answer, DCM_AdmissionID);
  data.accession = words(&answer, DCM_AccessionNumber);
  data.study_uid = text(&answer, DCM_StudyInstanceUID);
  data.procedure_id = words(&answer, DCM_RequestedProcedureID);
  data.description = words(&answer, DCM_RequestedProcedureDescription);
  DcmItem* step = first_item(&answer, DCM_ScheduledProcedureStepSequence);
  if (data.description.empty()) data.description = words(step, DCM_ScheduledProcedureStepDescription);
  take_code(data, first_item(&answer, DCM_RequestedProcedureCodeSequence));
  take_code(data, first_item(step, DCM_ScheduledProtocolCodeSequence));
  data.location = words(step, DCM_ScheduledProcedureStepLocation);
  if (data.location.empty()) data.location = words(step, DCM_ScheduledStationName);
  const auto staff = [&](const char* role, const std::string& name) {
    if (!name.empty()) data.staff.push_back({role, "", person(name)});
  };
  staff("performing", words(step, DCM_ScheduledPerformingPhysicianName));
  staff("requesting", words(&answer, DCM_RequestingPhysician));
  staff("referring", words(&answer, DCM_ReferringPhysicianName));
  const std::string date = text(step, DCM_ScheduledProcedureStepStartDate);
  const std::string time = text(step, DCM_ScheduledProcedureStepStartTime);
  const std::string day = plain_date(date), clock = plain_time(time);
  data.planned = planned_text(day.empty() ? date : day, clock);
  take_moment(item, date, time, text(&answer, DCM_TimezoneOffsetFromUTC));
  return item;
}

}  // namespace

std::string prepare_worklist_query() {
  silence_dcmtk();
  ::tzset();
  keep_charsets_at_hand();
  if (dcmDataDict.isDictionaryLoaded()) return "";
  return "cannot be asked: DCMTK's data dictionary (dicom.dic) is not installed";
}

WorklistAnswer query_worklist(const WorklistOptions& options, UtcTime now) {
  WorklistAnswer answer;
  const auto fail = [&](const std::string& what, const OFCondition& why) {
    answer = {};
    answer.problem = what + (why.bad() ? std::string(": ") + why.text() : "");
    return answer;
  };
  Query query;
  query.setAETitle(options.calling_ae);
  query.setPeerAETitle(options.called_ae);
  query.setPeerHostName(options.host);
  query.setPeerPort(options.port);
  const auto seconds = static_cast<Uint32>(options.timeout.count());
  query.setConnectionTimeout(static_cast<Sint32>(seconds));
  query.setACSETimeout(seconds);
  query.setDIMSEBlockingMode(DIMSE_NONBLOCKING);
  query.setDIMSETimeout(seconds);
  OFList<OFString> syntaxes;
  syntaxes.emplace_back(UID_LittleEndianExplicitTransferSyntax);
  syntaxes.emplace_back(UID_LittleEndianImplicitTransferSyntax);
  query.addPresentationContext(UID_FINDModalityWorklistInformationModel, syntaxes);
  if (const OFCondition result = query.initNetwork(); result.bad()) return fail("cannot be asked", result);
  if (const OFCondition result = query.negotiateAssociation(); result.bad())
    return fail("cannot be asked", result);
  const auto context = query.findPresentationContextID(UID_FINDModalityWorklistInformationModel, "");
  if (context == 0) {
    query.releaseAssociation();
    return fail("has no modality worklist", EC_Normal);
  }
  DcmDataset question;
  fill_question(question, options, now);
  OFList<QRResponse*> responses;
  const OFCondition result = query.sendFINDRequest(context, &question, &responses);
  Uint16 status = STATUS_Success;
  for (QRResponse* response : responses) {
    status = response->m_status;
    if (result.good() && response->m_dataset != nullptr && answer.items.size() < kMostWorklistItems) {
      if (is_asked_for(*response->m_dataset, options)) {
        answer.items.push_back(read_item(*response->m_dataset));
      } else {
        ++answer.not_asked_for;
      }
    }
    delete response;
  }
  answer.is_cut = query.cut();
  if (result.good() && !query.cut()) {
    query.releaseAssociation();
  } else {
    query.abortAssociation();
  }
  if (result.bad()) return fail("did not answer to the end", result);
  if (status != STATUS_Success && !query.cut()) {
    return fail("refused the question with status " + std::to_string(status), EC_Normal);
  }
  return answer;
}

}  // namespace kiroku::recorder
