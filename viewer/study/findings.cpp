#include "viewer/study/findings.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

namespace kiroku::study {
namespace {

using trainer::AgreementWeights;

/// Points of one question by film and reader, the first time each film was seen.
class Table {
 public:
  Table(const std::vector<Rating>& ratings, std::size_t question) {
    for (const Rating& one : ratings) {
      if (!one.again && one.points.at(question) > 0)
        points_[{one.clip, one.coding}][one.reader] = one.points[question];
    }
  }
  using Film = std::pair<std::size_t, std::size_t>;  // clip, coding
  using ByReader = std::map<std::size_t, int>;
  [[nodiscard]] const std::map<Film, ByReader>& films() const { return points_; }
  [[nodiscard]] const ByReader* of(std::size_t clip, std::size_t coding) const {
    const auto found = points_.find({clip, coding});
    return found == points_.end() ? nullptr : &found->second;
  }

 private:
  std::map<Film, ByReader> points_;
};

double median_of(std::vector<int> values) {
  std::ranges::sort(values);
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2.0;
}

trainer::Agreement agreement_of(const std::vector<Table::ByReader>& films, std::size_t readers,
                                AgreementWeights weights) {
  if (readers == 2) {
    std::vector<std::pair<int, int>> pairs;
    for (const Table::ByReader& film : films) {
      if (film.contains(0) && film.contains(1)) pairs.emplace_back(film.at(0) - 1, film.at(1) - 1);
    }
    return trainer::cohens_kappa(pairs, kPoints, weights);
  }
  std::vector<std::vector<int>> all;
  for (const Table::ByReader& film : films) {
    std::vector<int>& of_film = all.emplace_back();
    for (const auto& [reader, points] : film) of_film.push_back(points - 1);
  }
  return trainer::fleiss_kappa(all, kPoints, weights);
}

/// Of one coding, or of all of them.
Points points_of(const Table& table, std::optional<std::size_t> coding, std::size_t readers) {
  Points found;
  std::vector<Table::ByReader> films;
  std::vector<int> values;
  for (const auto& [film, by_reader] : table.films()) {
    if (coding && film.second != *coding) continue;
    films.push_back(by_reader);
    for (const auto& [reader, points] : by_reader) {
      values.push_back(points);
      ++found.given.at(static_cast<std::size_t>(points - 1));
    }
  }
  found.count = values.size();
  if (!values.empty()) {
    const auto count = static_cast<double>(values.size());
    found.mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
    found.share_judged =
        static_cast<double>(std::ranges::count_if(values, [](int one) { return one >= kJudged; })) / count;
    found.median = median_of(values);
  }
  if (readers > 1) {
    found.agreement = agreement_of(films, readers, AgreementWeights::kNone);
    found.agreement_quadratic = agreement_of(films, readers, AgreementWeights::kQuadratic);
  }
  return found;
}

CodingDifference difference_of(const Table& table, std::size_t clips, std::size_t first, std::size_t second) {
  CodingDifference found;
  found.first = first;
  found.second = second;
  std::vector<double> differences;
  for (std::size_t clip = 0; clip < clips; ++clip) {
    const Table::ByReader *of_first = table.of(clip, first), *of_second = table.of(clip, second);
    if (of_first == nullptr || of_second == nullptr) continue;
    int sum = 0, readers = 0;
    for (const auto& [reader, points] : *of_first) {
      if (const auto other = of_second->find(reader); other != of_second->end()) {
        sum += points - other->second;
        ++readers;
      }
    }
    if (readers == 0) continue;
    differences.push_back(static_cast<double>(sum) / readers);
    ++(sum > 0 ? found.higher : sum < 0 ? found.lower : found.equal);
  }
  if (!differences.empty()) {
    found.mean = std::accumulate(differences.begin(), differences.end(), 0.0) /
                 static_cast<double>(differences.size());
  }
  found.test = trainer::signed_ranks(differences);
  return found;
}

OwnAgreement own_agreement(const std::vector<Rating>& ratings, std::size_t reader, std::size_t question) {
  OwnAgreement found;
  found.reader = reader;
  found.question = question;
  std::vector<std::pair<int, int>> pairs;
  for (const Rating& later : ratings) {
    if (!later.again || later.reader != reader || later.points[question] == 0) continue;
    for (const Rating& first : ratings) {
      const bool same_film =
          first.reader == reader && !first.again && first.clip == later.clip && first.coding == later.coding;
      if (!same_film || first.points[question] == 0) continue;
      const int apart = std::abs(first.points[question] - later.points[question]);
      pairs.emplace_back(first.points[question] - 1, later.points[question] - 1);
      found.same += apart == 0 ? 1 : 0;
      found.within_one += apart <= 1 ? 1 : 0;
    }
  }
  found.count = pairs.size();
  found.agreement = trainer::cohens_kappa(pairs, kPoints, AgreementWeights::kNone);
  found.agreement_quadratic = trainer::cohens_kappa(pairs, kPoints, AgreementWeights::kQuadratic);
  return found;
}

}  // namespace

std::vector<Rating> ratings_of(const Study& study, const StudyKey& key,
                               const std::vector<NewestAnswers>& answers) {
  std::map<std::string, const StudyKey::Film*> films;
  for (const StudyKey::Film& film : key.films) films[film.name] = &film;
  std::vector<Rating> ratings;
  for (std::size_t reader = 0; reader < study.readers.size(); ++reader) {
    std::set<std::string> before;
    for (std::size_t place = 0; place < study.readers[reader].showings.size(); ++place) {
      const Showing& showing = study.readers[reader].showings[place];
      const bool again = !before.insert(showing.film).second;
      const auto answer = answers.at(reader).find(showing.token);
      if (answer == answers[reader].end()) continue;
      const StudyKey::Film& film = *films.at(showing.film);
      ratings.push_back({reader, film.clip, film.coding, place, again, answer->second.points,
                         answer->second.seen, answer->second.utc});
    }
  }
  return ratings;
}

Findings findings_of(const Study& study, const StudyKey& key, const std::vector<Rating>& ratings) {
  Findings found;
  const std::size_t readers = study.readers.size(), codings = key.codings.size();
  found.by_coding.resize(codings);
  for (std::size_t question = 0; question < study.questions.size(); ++question) {
    const Table table(ratings, question);
    for (std::size_t coding = 0; coding < codings; ++coding)
      found.by_coding[coding].push_back(points_of(table, coding, readers));
    found.together.push_back(points_of(table, std::nullopt, readers));
    for (std::size_t first = 0; first < codings; ++first) {
      for (std::size_t second = first + 1; second < codings; ++second) {
        found.differences.push_back(difference_of(table, key.clips.size(), first, second));
        found.differences.back().question = question;
      }
    }
  }
  std::vector<double> p;
  for (const CodingDifference& one : found.differences) {
    if (one.test.p) p.push_back(*one.test.p);
  }
  const std::vector<double> adjusted = trainer::holm_adjusted(p);
  std::size_t next = 0;
  for (CodingDifference& one : found.differences) {
    if (one.test.p) one.p_adjusted = adjusted[next++];
  }
  for (std::size_t reader = 0; reader < readers; ++reader) {
    const bool twice =
        std::ranges::any_of(ratings, [&](const Rating& one) { return one.reader == reader && one.again; });
    for (std::size_t question = 0; twice && question < study.questions.size(); ++question)
      found.own.push_back(own_agreement(ratings, reader, question));
  }
  for (const Rating& one : ratings) {
    found.pictures += one.seen.pictures;
    found.dropped += one.seen.dropped;
    found.never_to_the_end += one.seen.plays == 0 ? 1 : 0;
  }
  return found;
}

}  // namespace kiroku::study
