#include "apps/vocabulary/place_evaluation.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <span>

#include <fmt/format.h>

#include "apps/vocabulary/place_set.hpp"
#include "io/files/io_error.hpp"
#include "io/plots/plot.hpp"
#include "loopclosure/loop_closer.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// What became of one candidate of a query.
struct Tried {
  int place = -1;
  double score = 0;
  bool verified = false;
  VerificationReport stages;
};

/// The best answer to one query.
struct Answer {
  int query = 0;
  int place = -1;     ///< of recognition alone
  double score = 0;   ///< relative to the score with the image before
  int verified = -1;  ///< place; -1: none of the candidates was
  SE3 T_query_place;  ///< when verified
  std::vector<Tried> tried;
};

/// The place and those of the earlier images that see the same by their true poses, nearest first: what a
/// keyframe's neighbours are in a map.
std::vector<PlacedView> views_of(const PlaceSet& set, const TruePairs& truth, int place, int end) {
  const auto& own = set.places[static_cast<std::size_t>(place)];
  std::vector<std::pair<double, int>> near;
  for (int k = 0; k < end && own.T_w_c; ++k) {
    const auto& other = set.places[static_cast<std::size_t>(k)];
    if (k == place || !other.T_w_c || truth.of(place, k) != Truth::kSame) continue;
    near.emplace_back(truth.separation(place, k), k);
  }
  std::sort(near.begin(), near.end());
  std::vector<PlacedView> views{{&own.view, SE3()}};
  for (const auto& [separation, k] : near) {
    if (static_cast<int>(views.size()) >= LoopCloserOptions().place_views) break;
    const auto& other = set.places[static_cast<std::size_t>(k)];
    views.push_back({&other.view, other.T_w_c->inverse() * *own.T_w_c});
  }
  return views;
}

/// Tries to verify the candidates, best first, until one is.
void verify_candidates(const PlaceSet& set, const TruePairs& truth, int end, double reference,
                       std::span<const PlaceCandidate> candidates, Answer& answer) {
  const DescribedPlace& view = set.places[static_cast<std::size_t>(answer.query)].view;
  for (const PlaceCandidate& candidate : candidates) {
    Tried& tried = answer.tried.emplace_back();
    tried.place = static_cast<int>(index(candidate.keyframe));
    tried.score = candidate.score / reference;
    const auto verified =
        verify_place(set.rig, views_of(set, truth, tried.place, end), view, {}, &tried.stages);
    tried.verified = verified.has_value();
    if (!verified) continue;
    answer.verified = tried.place;
    answer.T_query_place = verified->T_b_a;
    return;
  }
}

std::vector<Answer> ask(const PlaceEvaluationArguments& arguments, const PlaceSet& set,
                        const TruePairs& truth, const Vocabulary& vocabulary) {
  PlaceIndex index(vocabulary.word_count());
  std::vector<Answer> answers;
  const RecogniserOptions recogniser;
  for (int i = arguments.gap + 1; i < static_cast<int>(set.places.size()); ++i) {
    const DescribedPlace& view = set.places[static_cast<std::size_t>(i)].view;
    const int end = i - arguments.gap;  // of the images in the index
    index.add(KeyframeId{static_cast<std::uint32_t>(end - 1)},
              set.places[static_cast<std::size_t>(end - 1)].view.bag);
    const auto candidates = index.query(view.bag, static_cast<std::size_t>(recogniser.max_candidates),
                                        [](KeyframeId) { return true; });
    if (candidates.empty()) continue;
    const double likeness = bag_score(view.bag, set.places[static_cast<std::size_t>(i - 1)].view.bag);
    const double reference = std::max(likeness, recogniser.min_previous_score);
    Answer answer;
    answer.query = i;
    answer.place = static_cast<int>(twofold::index(candidates[0].keyframe));
    answer.score = candidates[0].score / reference;
    if (set.rig.kind != SensorKind::kMono) {
      verify_candidates(set, truth, end, reference, candidates, answer);
    }
    answers.push_back(answer);
  }
  return answers;
}

struct Counts {
  int right = 0, wrong = 0;
  [[nodiscard]] double precision() const { return right + wrong > 0 ? 1.0 * right / (right + wrong) : 1.0; }
};

/// Does any of the images that the query was compared with show its place?
bool answerable(const PlaceEvaluationArguments& arguments, const TruePairs& truth, int query) {
  for (int j = 0; j < query - arguments.gap; ++j) {
    if (truth.of(query, j) == Truth::kSame) return true;
  }
  return false;
}

int count_answerable(const PlaceEvaluationArguments& arguments, const PlaceSet& set, const TruePairs& truth) {
  int count = 0;
  for (int i = 0; i < static_cast<int>(set.places.size()); ++i) count += answerable(arguments, truth, i);
  return count;
}

void count(const TruePairs& truth, const Answer& answer, Counts& counts) {
  const Truth t = truth.of(answer.query, answer.place);
  counts.right += t == Truth::kSame ? 1 : 0;
  counts.wrong += t == Truth::kOther ? 1 : 0;
}

void print_recognition(std::vector<Answer> answers, const TruePairs& truth, int possible,
                       std::vector<std::pair<double, double>>& curve) {
  std::stable_sort(answers.begin(), answers.end(),
                   [](const Answer& a, const Answer& b) { return a.score > b.score; });
  Counts counts;
  double recall_at_full_precision = 0, full_precision_threshold = 0;
  Counts at_threshold;
  for (const Answer& answer : answers) {
    count(truth, answer, counts);
    const double recall = std::min(1.0, 1.0 * counts.right / std::max(1, possible));
    curve.emplace_back(recall, counts.precision());
    if (counts.wrong == 0) {
      recall_at_full_precision = recall;
      full_precision_threshold = answer.score;
    }
    if (answer.score >= RecogniserOptions().min_score) at_threshold = counts;
  }
  fmt::print("recognition alone      at {:.2f}: precision {:.3f}, recall {:.3f} ({} right, {} wrong)\n",
             RecogniserOptions().min_score, at_threshold.precision(),
             std::min(1.0, 1.0 * at_threshold.right / std::max(1, possible)), at_threshold.right,
             at_threshold.wrong);
  fmt::print("                       recall at 100 % precision {:.3f} (threshold {:.3f})\n",
             recall_at_full_precision, full_precision_threshold);
}

/// How wrong the pose of a verified answer is.
struct PoseError {
  double distance, angle_deg;
  /// By more than a third of what may lie between two images of the same place.
  [[nodiscard]] bool wrong(const PlaceEvaluationArguments& arguments) const {
    return 3 * distance > arguments.max_distance || 3 * angle_deg > arguments.max_angle_deg;
  }
};

std::optional<PoseError> pose_error(const PlaceSet& set, const Answer& answer) {
  const auto& T_w_q = set.places[static_cast<std::size_t>(answer.query)].T_w_c;
  const auto& T_w_p = set.places[static_cast<std::size_t>(answer.verified)].T_w_c;
  if (!T_w_q || !T_w_p) return std::nullopt;
  const SE3 error = answer.T_query_place * T_w_p->inverse() * *T_w_q;
  const double angle = error.so3().log().norm() * 180 / std::numbers::pi;
  return PoseError{error.translation().norm(), angle};
}

/// A verified answer claims a pose: where true poses are known, it is right when that is, from however far
/// the place was seen. Recall counts the queries that have a true place.
/// @return  recall and precision after verification; none when nothing was verified
std::optional<std::pair<double, double>> print_verified(const PlaceEvaluationArguments& arguments,
                                                        const std::vector<Answer>& answers,
                                                        const PlaceSet& set, const TruePairs& truth,
                                                        int possible) {
  Counts counts;
  int recalled = 0;
  std::vector<double> errors_m, errors_deg;
  for (const Answer& answer : answers) {
    if (answer.verified < 0) continue;
    const auto error = pose_error(set, answer);
    const bool right =
        error ? !error->wrong(arguments) : truth.of(answer.query, answer.verified) == Truth::kSame;
    ++(right ? counts.right : counts.wrong);
    recalled += right && answerable(arguments, truth, answer.query) ? 1 : 0;
    if (!error) continue;
    errors_m.push_back(error->distance);
    errors_deg.push_back(error->angle_deg);
  }
  if (counts.right + counts.wrong == 0) {
    fmt::print("after verification     recall 0.000 (nothing verified)\n");
    return std::nullopt;
  }
  const double recall = 1.0 * recalled / std::max(1, possible);
  fmt::print("after verification     precision {:.3f}, recall {:.3f} ({} right, {} wrong)\n",
             counts.precision(), recall, counts.right, counts.wrong);
  if (errors_m.empty()) return std::pair(recall, counts.precision());
  std::sort(errors_m.begin(), errors_m.end());
  std::sort(errors_deg.begin(), errors_deg.end());
  fmt::print("pose of the closures   error median {:.3f} m, {:.2f} deg; worst {:.3f} m, {:.2f} deg\n",
             errors_m[errors_m.size() / 2], errors_deg[errors_deg.size() / 2], errors_m.back(),
             errors_deg.back());
  return std::pair(recall, counts.precision());
}

void write_csv(const std::string& file, const std::vector<Answer>& answers, const TruePairs& truth) {
  std::ofstream out(file);
  out << "query,place,same_place,score,matches,ransac_inliers,guided,inliers,well_spread,verified\n";
  for (const Answer& answer : answers) {
    for (const Tried& t : answer.tried) {
      const Truth same = truth.of(answer.query, t.place);
      out << fmt::format("{},{},{},{:.4f},{},{},{},{},{:d},{:d}\n", answer.query, t.place,
                         same == Truth::kSame ? "yes" : (same == Truth::kOther ? "no" : "part"), t.score,
                         t.stages.matches, t.stages.ransac_inliers, t.stages.guided, t.stages.inliers,
                         t.stages.well_spread, t.verified);
    }
  }
  if (!out.flush()) throw IoError(file, "cannot be written");
}

/// Precision over recall in [0, 1]^2: of recognition alone as a curve, after verification as a dot.
cv::Mat draw(const std::string& title, const std::vector<std::pair<double, double>>& curve,
             const std::optional<std::pair<double, double>>& verified) {
  constexpr int kSide = 400, kMargin = 50;
  cv::Mat image(kSide + 2 * kMargin, kSide + 2 * kMargin, CV_8UC3, cv::Scalar::all(255));
  const auto at = [&](double recall, double precision) {
    return cv::Point(kMargin + static_cast<int>(recall * kSide),
                     kMargin + static_cast<int>((1 - precision) * kSide));
  };
  for (int tick = 0; tick <= 5; ++tick) {
    const double x = 0.2 * tick;
    cv::line(image, at(x, 0), at(x, 1), cv::Scalar::all(220));
    cv::line(image, at(0, x), at(1, x), cv::Scalar::all(220));
    cv::putText(image, fmt::format("{:.1f}", x), at(x, 0) + cv::Point(-10, 18), cv::FONT_HERSHEY_SIMPLEX, 0.4,
                {});
    cv::putText(image, fmt::format("{:.1f}", x), at(0, x) + cv::Point(-30, 4), cv::FONT_HERSHEY_SIMPLEX, 0.4,
                {});
  }
  for (std::size_t i = 1; i < curve.size(); ++i) {
    cv::line(image, at(curve[i - 1].first, curve[i - 1].second), at(curve[i].first, curve[i].second),
             plot_colours::kFinal, 2, cv::LINE_AA);
  }
  if (verified) {
    const cv::Point dot = at(verified->first, verified->second);
    cv::circle(image, dot, 6, plot_colours::kCausal, cv::FILLED, cv::LINE_AA);
    cv::putText(image, "verified", dot + cv::Point(verified->first > 0.8 ? -60 : 8, 22),
                cv::FONT_HERSHEY_SIMPLEX, 0.45, plot_colours::kCausal);
  }
  cv::putText(image, "recall", at(0.45, 0) + cv::Point(0, 38), cv::FONT_HERSHEY_SIMPLEX, 0.5, {});
  cv::putText(image, "precision: " + title, cv::Point(10, 30), cv::FONT_HERSHEY_SIMPLEX, 0.45, {});
  return image;
}

}  // namespace

void evaluate_places(const PlaceEvaluationArguments& arguments, const Vocabulary& vocabulary) {
  const PlaceSet set = load_place_set(arguments, vocabulary);
  const TruePairs truth(arguments, set);
  const std::vector<Answer> answers = ask(arguments, set, truth, vocabulary);
  const int possible = count_answerable(arguments, set, truth);
  fmt::print("{}\n{} images, {} of them show a place seen before\n", arguments.set, set.places.size(),
             possible);
  std::vector<std::pair<double, double>> curve;
  print_recognition(answers, truth, possible, curve);
  std::optional<std::pair<double, double>> verified;
  if (set.rig.kind != SensorKind::kMono) verified = print_verified(arguments, answers, set, truth, possible);
  if (!arguments.csv.empty()) write_csv(arguments.csv, answers, truth);
  if (!arguments.plot.empty()) {
    const fs::path folder = fs::path(arguments.set).lexically_normal();
    write_png(arguments.plot, draw(folder.filename().string(), curve, verified));
  }
}

}  // namespace twofold
