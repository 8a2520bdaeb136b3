#include "engine/trace.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <ostream>
#include <utility>

#include "base/check.hpp"
#include "base/text_of_json.hpp"

namespace twofold {
namespace {

std::string quoted(const std::string& text) {
  return text_of_json(nlohmann::json(text));
}

/// Microseconds with all three decimals: a double in JSON would round stamps of a long run.
std::string microseconds(std::int64_t ns) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%lld.%03d", static_cast<long long>(ns / 1000),
                static_cast<int>(ns % 1000));
  return text.data();
}

}  // namespace

TraceTrack::TraceTrack(std::string thread_name, std::size_t capacity)
    : thread_name_(std::move(thread_name)), ring_(capacity) {
  TWOFOLD_CHECK(capacity > 0, "trace capacity");
}

TraceName Trace::name(std::string_view text) {
  const auto found = std::find(names_.begin(), names_.end(), text);
  if (found != names_.end()) return static_cast<TraceName>(found - names_.begin());
  TWOFOLD_CHECK(names_.size() <= std::numeric_limits<TraceName>::max(), "too many trace names");
  names_.emplace_back(text);
  return static_cast<TraceName>(names_.size() - 1);
}

TraceTrack& Trace::add_track(std::string thread_name, std::size_t capacity) {
  return tracks_.emplace_back(std::move(thread_name), capacity);
}

void Trace::write_track(std::ostream& out, const TraceTrack& track, std::size_t thread,
                        std::int64_t origin_ns) const {
  const std::string ids = ",\"pid\":1,\"tid\":" + std::to_string(thread + 1);
  out << (thread == 0 ? "\n" : ",\n") << R"({"ph":"M","name":"thread_name")" << ids << R"(,"args":{"name":)"
      << quoted(track.thread_name_) << "}}";
  const std::size_t oldest = track.overwritten() > 0 ? track.next_ : 0;
  for (std::size_t i = 0; i < track.size(); ++i) {
    const TraceTrack::Event& event = track.ring_[(oldest + i) % track.ring_.size()];
    const bool span = event.kind == TraceTrack::Kind::kSpan;
    out << (span ? ",\n{\"ph\":\"X\",\"name\":" : ",\n{\"ph\":\"C\",\"name\":") << quoted(names_[event.name])
        << ids << ",\"ts\":" << microseconds(event.t_ns - origin_ns);
    if (span) {
      out << ",\"dur\":" << microseconds(std::max<std::int64_t>(event.amount, 0)) << '}';
    } else {
      out << ",\"args\":{\"value\":" << event.amount << "}}";
    }
  }
}

bool Trace::write(std::ostream& out) const {
  std::int64_t origin_ns = std::numeric_limits<std::int64_t>::max();
  for (const TraceTrack& track : tracks_) {
    for (std::size_t i = 0; i < track.size(); ++i) origin_ns = std::min(origin_ns, track.ring_[i].t_ns);
  }
  nlohmann::json overwritten = nlohmann::json::object();
  out << R"({"displayTimeUnit":"ms","traceEvents":[)";
  for (std::size_t thread = 0; thread < tracks_.size(); ++thread) {
    write_track(out, tracks_[thread], thread, origin_ns);
    overwritten[tracks_[thread].thread_name_] = tracks_[thread].overwritten();
  }
  out << "\n],\"otherData\":{\"overwritten_events\":" << text_of_json(overwritten) << "}}\n";
  return static_cast<bool>(out.flush());
}

}  // namespace twofold
