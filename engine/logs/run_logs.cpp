#include "engine/logs/run_logs.hpp"

#include <fstream>
#include <iterator>
#include <system_error>

#include "evaluation/tum_line.hpp"

namespace twofold {

RunLogs::RunLogs(const RunLogOptions& options, ReplacementLog& replacements) : options_(options) {
  if (!options_.folder.empty()) {
    open_files(replacements);
    return;
  }
  frames_.keep_newest(options_.frames_in_memory);
  corrections_.keep_newest(options_.frames_in_memory);
  replacements.keep_newest(options_.frames_in_memory);
}

void RunLogs::open_files(ReplacementLog& replacements) {
  const auto unnamed = [this](const char* records, bool goes_on, const char* loss) {
    return LogFile::unnamed(options_.folder, {records, goes_on, loss});
  };
  const auto frames = unnamed("records of frames", true, "their frames lack a final pose");
  const auto corrections = unnamed("corrections of the map", true, "");
  const char* const hanging = "final poses of frames on keyframes that were culled may be wrong";
  const auto culled = unnamed("replacements of keyframes", false, hanging);
  const auto scaled = unnamed("scales of keyframes", false, hanging);
  causal_ = std::make_shared<LogFile>(options_.folder / "trajectory_causal.txt",
                                      LogContent{.records = "poses", .goes_on = true, .loss = ""});
  schedule_file_ = std::make_shared<LogFile>(
      options_.folder / "schedule.log",
      LogContent{.records = "steps", .goes_on = false, .loss = "a replay goes as far as the first of them"});
  frames_.keep_in(frames);
  corrections_.keep_in(corrections);
  replacements.keep_in(culled, scaled);
  schedule_.keep_in(schedule_file_);
  causal_->append(kTumHeader);
  writer_.emplace(std::vector{frames, corrections, culled, scaled, causal_, schedule_file_});
}

void RunLogs::add(const FrameRecord& record, const PoseCorrection& correction) {
  counts_.add(record.state);
  frames_.push_back(record);
  if (correction.reason != CorrectionReason::kNone) corrections_.push_back(correction);
  if (causal_ && record.state == FrameState::kTracked) add_causal(record);
}

void RunLogs::add_causal(const FrameRecord& record) {
  std::string text;
  if (gap_.poses > 0)
    text = "# " + std::to_string(gap_.poses) + " poses are missing, from " + seconds_text(gap_.first_t_ns) +
           " to " + seconds_text(gap_.last_t_ns) + ": there was no room on the disk\n";
  if (record.part_causal != part_ && part_ != kNoKeyframe)
    text += "# another map part, in a world of its own: " + std::to_string(index(record.part_causal)) + "\n";
  text += tum_line({record.t_ns, record.T_c_w_causal.unpacked().inverse()});
  if (causal_->append(text, record.t_ns)) {
    gap_ = {};
    part_ = record.part_causal;
    return;
  }
  if (gap_.poses++ == 0) gap_.first_t_ns = record.t_ns;
  gap_.last_t_ns = record.t_ns;
}

void RunLogs::close(ReplacementLog& replacements, RunResult& result) {
  if (writer_) {
    ScheduleStreams::end(*schedule_file_);
    result.losses = writer_->finish();
    frames_.read_back();
    corrections_.read_back();
    replacements.read_back();
    if (result.losses.empty()) merge_schedule_file();
  }
  result.counts = counts_;
  result.frames = std::move(frames_);
  result.corrections = std::move(corrections_);
  result.schedule = std::move(schedule_);
}

void RunLogs::merge_schedule_file() {
  const std::filesystem::path file = options_.folder / "schedule.log";
  const std::filesystem::path beside = options_.folder / "schedule.log.new";
  std::ifstream in(file, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in), {}};
  const auto merged = merge_schedule(bytes);
  if (!merged) return;  // as it is it can be read no worse
  std::ofstream out(beside, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(merged->data()), static_cast<std::streamsize>(merged->size()));
  out.close();
  std::error_code error;
  if (out) std::filesystem::rename(beside, file, error);
  if (!out || error) std::filesystem::remove(beside, error);
}

}  // namespace twofold
