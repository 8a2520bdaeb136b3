#include <CLI/App.hpp>

#include "apps/twofold/commands.hpp"

int main(int argc, char** argv) {
  CLI::App app{"Twofold: real-time visual SLAM", "twofold"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "twofold " TWOFOLD_VERSION);
  int exit_code = twofold::kOk;
  twofold::add_run_command(app, exit_code);
  twofold::add_eval_command(app, exit_code);
  twofold::add_timing_command(app, exit_code);
  twofold::add_calibrate_command(app, exit_code);
  twofold::add_doctor_command(app, exit_code);
  twofold::add_object_command(app, exit_code);
  twofold::add_record_command(app, exit_code);
  twofold::add_devices_command(app, exit_code);
  twofold::add_render_command(app, exit_code);
  twofold::add_map_command(app, exit_code);
  twofold::add_surface_command(app, exit_code);
  twofold::add_view_command(app, exit_code);
  return twofold::run_command_line(app, argc, argv, exit_code);
}
