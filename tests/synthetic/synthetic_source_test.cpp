#include "io/sources/synthetic_source.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "io/sources/open_source.hpp"
#include "synthetic/synthetic_sequence.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

using Parameters = std::map<std::string, std::string>;

TEST(SyntheticSource, DeliversWhatItAnnounces) {
  const auto source = open_source("synthetic:courtyard?width=160&height=120&frames=5&seed=7");
  EXPECT_EQ(source->frame_count(), 5);
  EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
  EXPECT_DOUBLE_EQ(source->rig().camera.fx, 105);  // the field of view stays
  EXPECT_DOUBLE_EQ(source->rig().camera.cx, 79.5);
  ASSERT_EQ(source->ground_truth().size(), 5U);
  Frame frame;
  for (int i = 0; i < 5; ++i) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.index, i);
    EXPECT_EQ(frame.t_ns, source->ground_truth()[i].t_ns);
    EXPECT_EQ(frame.left.size(), cv::Size(160, 120));
    EXPECT_EQ(frame.right.size(), cv::Size(160, 120));
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
}

TEST(SyntheticSource, DefaultsAreThoseOfTheScenes) {
  const auto courtyard = open_synthetic("courtyard", {});
  EXPECT_EQ(courtyard->frame_count(), 1800);
  EXPECT_EQ(courtyard->rig().camera.width, 640);
  EXPECT_EQ(open_synthetic("courtyard", {{"rounds", "1"}})->frame_count(), 900);

  const auto descent = open_synthetic("descent", {});
  EXPECT_EQ(descent->frame_count(), 61);
  EXPECT_EQ(descent->rig().camera.width, 1024);
  EXPECT_NEAR(2 * std::atan(512 / descent->rig().camera.fx) * 180 / 3.14159265, 25, 1e-6);
  EXPECT_DOUBLE_EQ(descent->rig().baseline, 0.1);
  const Trajectory& truth = descent->ground_truth();
  EXPECT_NEAR(truth.front().T_w_c.translation().z(), 10, 1e-9);
  EXPECT_NEAR(truth.back().T_w_c.translation().z(), 1, 1e-9);
  EXPECT_NEAR(truth[1].T_w_c.translation().z(), 9.85, 1e-9);
}

TEST(SyntheticSource, LargeLoopsComeBackToWhereTheyWere) {
  // The quadrangle of the campus: round after round, after 3 rounds and after all of it.
  const auto campus = open_synthetic("campus", {{"fps", "2"}});
  const Trajectory& truth = campus->ground_truth();
  double path = 0, farthest = 0;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    path += (truth[i].T_w_c.translation() - truth[i - 1].T_w_c.translation()).norm();
    farthest = std::max(farthest, truth[i].T_w_c.translation().norm());
  }
  EXPECT_NEAR(path, 1800, 100);
  EXPECT_GT(farthest, 100);
  EXPECT_LT((truth.back().T_w_c.translation() - truth.front().T_w_c.translation()).norm(), 4);

  // The calibration of the cloister is rough: what is rendered is not what it says.
  const auto rough = open_synthetic("cloister", {});
  const auto exact = open_synthetic("cloister", {{"f_error", "0"}});
  EXPECT_NEAR(rough->rig().camera.fx / exact->rig().camera.fx, 0.9, 1e-12);
  Frame a, b;
  ASSERT_EQ(rough->next(a), FrameStatus::kFrame);
  ASSERT_EQ(exact->next(b), FrameStatus::kFrame);
  EXPECT_EQ(cv::norm(a.left, b.left, cv::NORM_INF), 0);
  EXPECT_EQ(rough->ground_truth().size(), static_cast<std::size_t>(rough->frame_count().value_or(0)));
}

TEST(SyntheticSource, TheTerraceNeverComesBackButLooksAsIfItDid) {
  const auto terrace = open_synthetic("terrace", {{"fps", "1"}});
  const Trajectory& truth = terrace->ground_truth();
  double path = 0, nearest = 1e9;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    const Vector3 here = truth[i].T_w_c.translation();
    path += (here - truth[i - 1].T_w_c.translation()).norm();
    for (std::size_t k = 0; k + 8 <= i; ++k)  // 8 s are 64 m
      nearest = std::min(nearest, (here - truth[k].T_w_c.translation()).norm());
  }
  EXPECT_NEAR(path, 3000, 20);
  EXPECT_GT(nearest, 60);
  // One house in four is painted; four pieces of road.
  const synthetic::SyntheticSequence sequence(synthetic::default_options("terrace"));
  EXPECT_EQ(sequence.scene().textures.size(), 4U * 6 + 4 + 6);
  EXPECT_GT(sequence.scene().quads.size(), 4000U);
}

TEST(SyntheticSource, ACameraIsCoveredAndCarriedElsewhere) {
  const Parameters small{{"width", "64"}, {"height", "48"}, {"fps", "10"}, {"noise", "0"}};
  const auto with = [&](Parameters more) {
    more.insert(small.begin(), small.end());
    return open_synthetic("desk", more);
  };
  const Parameters hand{{"frames", "10"}, {"cover_at", "0.3"}, {"cover", "0.4"}, {"carried_to", "1.5"}};
  Parameters away = hand;
  away["elsewhere"] = "9";
  const auto walk = with({{"frames", "20"}});
  const auto carried = with(hand);
  const auto elsewhere = with(away);
  std::vector<Frame> walked(20);
  for (Frame& frame : walked) ASSERT_EQ(walk->next(frame), FrameStatus::kFrame);

  const auto differs = [](const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) > 0; };
  for (int i = 0; i < 10; ++i) {
    Frame here, there;
    ASSERT_EQ(carried->next(here), FrameStatus::kFrame);
    ASSERT_EQ(elsewhere->next(there), FrameStatus::kFrame);
    EXPECT_EQ(here.t_ns, walked[static_cast<std::size_t>(i)].t_ns);
    if (i >= 3 && i < 7) {  // nothing but the hand
      double low = 0, high = 0;
      cv::minMaxLoc(here.left, &low, &high);
      EXPECT_EQ(low, high);
      EXPECT_FALSE(differs(here.left, here.right));
      continue;
    }
    const Frame& same = walked[static_cast<std::size_t>(i < 3 ? i : i - 7 + 15)];
    EXPECT_FALSE(differs(here.left, same.left)) << i;
    EXPECT_FALSE(differs(here.right, same.right)) << i;
    EXPECT_EQ(differs(there.left, same.left), i >= 7) << i;
  }
  // No truth behind the hand, nor in another place.
  ASSERT_EQ(carried->ground_truth().size(), 6U);
  EXPECT_EQ(carried->ground_truth()[3].t_ns, walked[7].t_ns);
  EXPECT_EQ(carried->ground_truth()[3].T_w_c.matrix(), walk->ground_truth()[15].T_w_c.matrix());
  EXPECT_EQ(elsewhere->ground_truth().size(), 3U);
}

TEST(SyntheticSource, DroppedFramesLeaveGaps) {
  const auto source =
      open_synthetic("desk", {{"width", "64"}, {"height", "48"}, {"frames", "200"}, {"drop", "0.25"}});
  EXPECT_GT(source->frame_count(), 120);
  EXPECT_LT(source->frame_count(), 180);
  const auto whole = open_synthetic("desk", {{"width", "64"}, {"height", "48"}, {"frames", "200"}});
  Frame frame;
  std::int64_t last = -1;
  int gaps = 0;
  std::size_t k = 0;
  while (source->next(frame) == FrameStatus::kFrame) {
    gaps += frame.index != last + 1;
    last = frame.index;
    EXPECT_EQ(frame.t_ns, whole->ground_truth()[static_cast<std::size_t>(frame.index)].t_ns);
    EXPECT_EQ(frame.t_ns, source->ground_truth()[k++].t_ns);
  }
  EXPECT_GT(gaps, 10);
}

TEST(SyntheticSource, EffectsShowInTheImages) {
  const Parameters base{
      {"width", "160"}, {"height", "120"}, {"frames", "60"}, {"noise", "0"}, {"sensor", "mono"}};
  const auto frame_with = [&](const std::string& key, const std::string& value, int at) {
    Parameters parameters = base;
    if (!key.empty()) parameters[key] = value;
    const auto source = open_synthetic("courtyard", parameters);
    Frame frame;
    for (int i = 0; i <= at; ++i) EXPECT_EQ(source->next(frame), FrameStatus::kFrame);
    return frame.left;
  };
  const auto changed = [](const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b); };
  const cv::Mat plain = frame_with("", "", 40);
  EXPECT_EQ(changed(plain, frame_with("exposure", "0", 40)), 0);
  EXPECT_GT(changed(plain, frame_with("blur", "0.8", 40)), 5000);
  EXPECT_LT(cv::mean(frame_with("exposure", "0.5", 40))[0], 0.95 * cv::mean(plain)[0]);
  const int object = changed(plain, frame_with("object", "1", 40));
  EXPECT_GT(object, 50);
  EXPECT_LT(object, 8000);
}

TEST(SyntheticSource, WrongParametersAreNamed) {
  EXPECT_IO_ERROR(
      open_synthetic("castle", {}),
      "unknown scene 'castle' (known: campus, cloister, corridor, courtyard, descent, desk, landing, "
      "terrace, turntable)");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"colour", "1"}}), "unknown parameter 'colour'");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"width", "many"}}), "width='many' is not a number");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"width", "10"}}), "width must be between 32 and 4096");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"height", "480.5"}}), "height must be a whole number");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"f", "-400"}}), "f must be between");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"fps", "0"}}), "fps must be between");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"noise", "-1"}}), "noise must be between");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"frames", "-5"}}), "frames must be a whole number");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"frames", "1e12"}}), "frames is too large");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"sensor", "lidar"}}),
                  "sensor='lidar' must be stereo, rgbd or mono");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"object", "2"}}), "object must be 0 or 1");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"bare", "2"}}), "bare must be 0 or 1");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"walkers", "1"}}),
                  "walkers need ground to walk on, which desk has not");
  EXPECT_IO_ERROR(open_synthetic("descent", {{"plain", "1"}}),
                  "plain panels need walls, which descent has not");
  EXPECT_IO_ERROR(open_synthetic("turntable", {{"motion", "3"}}), "motion must be between 0 and 2");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"motion", "1"}}),
                  "shape, texture and motion are the turntable's, not of desk");
  EXPECT_IO_ERROR(open_synthetic("corridor", {{"walkers", "17"}}), "walkers must be between 0 and 16");
  EXPECT_IO_ERROR(open_synthetic("corridor", {{"flicker", "1"}}), "flicker must be between");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"drop", "0.95"}}), "drop must be between");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"shutter", "0.034"}}), "shutter must be between");
  EXPECT_IO_ERROR(open_synthetic("desk", {{"shutter", "0.02"}, {"readout", "-0.02"}}),
                  "readout must be between");
  EXPECT_IO_ERROR(open_source("synthetic:desk?blur"), "blur");
}

}  // namespace
}  // namespace twofold
