#include <algorithm>
#include <cmath>

#include "base/option_check.hpp"
#include "twofold/viewer.hpp"
#include "viewer/scene.hpp"
#include "viewer/server.hpp"

namespace twofold {
namespace {

void check_address(const std::string& bind, int port, OptionCheck& check) {
  check.rule(!bind.empty(), "bind must be an address, is empty").within("port", port, 0, 65535);
}

}  // namespace

std::string ViewServerOptions::invalid_reason() const {
  OptionCheck check;
  check_address(bind, port, check);
  return check.above("request_time", static_cast<double>(request_time.count()), 0).reason();
}

std::string ViewerOptions::invalid_reason() const {
  OptionCheck check;
  check_address(bind, port, check);
  check.rule(stages.size() <= kViewStages, "stages must be 8 at most")
      .that(std::isfinite(frame_period) && frame_period >= 0, "frame_period", "finite and >= 0", frame_period)
      .rule(paced_by.empty() || paced_by == "camera" || paced_by == "recording",
            "paced_by must be \"camera\", \"recording\" or empty")
      .rule(std::is_sorted(truth_t_ns.begin(), truth_t_ns.end()), "truth_t_ns must be ascending");
  return check.reason();
}

}  // namespace twofold
