#include "engine/trace.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "engine/stage_timer.hpp"

namespace twofold {
namespace {

nlohmann::json written(const Trace& trace) {
  std::ostringstream out;
  EXPECT_TRUE(trace.write(out));
  return nlohmann::json::parse(out.str());
}

TEST(Trace, WritesOneTrackAThreadWithSpansAndCounters) {
  Trace trace;
  const TraceName pyramid = trace.name("pyramid");
  const TraceName depth = trace.name("queue \"depth\"");
  EXPECT_EQ(trace.name("pyramid"), pyramid);
  TraceTrack& tracker = trace.add_track("tracker");
  TraceTrack& mapper = trace.add_track("mapper");
  tracker.span(pyramid, 5'000'001'234, 2'500);
  tracker.counter(depth, 5'000'002'000, 3);
  mapper.span(pyramid, 5'000'000'000, 1'000'000);
  const nlohmann::json events = written(trace).at("traceEvents");
  ASSERT_EQ(events.size(), 5u);  // two thread names
  EXPECT_EQ(events[0].at("args").at("name"), "tracker");
  EXPECT_EQ(events[1].at("ph"), "X");
  EXPECT_EQ(events[1].at("name"), "pyramid");
  EXPECT_DOUBLE_EQ(events[1].at("ts").get<double>(), 1.234);
  EXPECT_DOUBLE_EQ(events[1].at("dur").get<double>(), 2.5);
  EXPECT_EQ(events[2].at("ph"), "C");
  EXPECT_EQ(events[2].at("name"), "queue \"depth\"");
  EXPECT_EQ(events[2].at("args").at("value"), 3);
  EXPECT_EQ(events[4].at("tid"), 2);
  EXPECT_DOUBLE_EQ(events[4].at("ts").get<double>(), 0.0);
}

TEST(Trace, OverflowLosesTheOldestAndSaysHowMany) {
  Trace trace;
  const TraceName name = trace.name("step");
  TraceTrack& track = trace.add_track("tracker", 4);
  for (int i = 0; i < 11; ++i) track.span(name, i * 1000, 10);
  EXPECT_EQ(track.overwritten(), 7u);
  const nlohmann::json file = written(trace);
  ASSERT_EQ(file.at("traceEvents").size(), 1u + 4u);
  for (int i = 0; i < 4; ++i) EXPECT_DOUBLE_EQ(file["traceEvents"][1 + i]["ts"].get<double>(), i);
  EXPECT_EQ(file["otherData"]["overwritten_events"]["tracker"], 7);
}

TEST(Trace, EmptyTraceIsValidJson) {
  EXPECT_TRUE(written(Trace()).at("traceEvents").empty());
}

TEST(Trace, ReportsAStreamThatFails) {
  Trace trace;
  std::ostringstream out;
  out.setstate(std::ios::badbit);
  EXPECT_FALSE(trace.write(out));
}

TEST(StageRecorder, ScopesGoIntoHistogramAndTrace) {
  Trace trace;
  StageRecorder recorder("tracker", &trace);
  const StageId pyramid = recorder.add_stage("pyramid");
  const StageId align = recorder.add_stage("align");
  const TraceName version = recorder.add_counter("version");
  for (int i = 0; i < 3; ++i) const ScopedStage timer(recorder, pyramid);
  recorder.record(align, 0, 4'000'000);
  recorder.counter(version, 17);
  EXPECT_EQ(recorder.histogram(pyramid).count(), 3u);
  EXPECT_EQ(recorder.to_json().at("pyramid").at("count"), 3);
  EXPECT_NEAR(recorder.to_json().at("align").at("p50_ms").get<double>(), 4.0, 0.04);
  EXPECT_EQ(written(trace).at("traceEvents").size(), 1u + 5u);
}

TEST(StageRecorder, WorksWithoutATrace) {
  StageRecorder recorder("tracker");
  const StageId stage = recorder.add_stage("pyramid");
  recorder.counter(recorder.add_counter("version"), 1);
  { const ScopedStage timer(recorder, stage); }
  EXPECT_EQ(recorder.histogram(stage).count(), 1u);
}

}  // namespace
}  // namespace twofold
