#pragma once

#include "apps/command_line.hpp"

namespace twofold {

/// One a file: adds its subcommand to the program. The subcommand runs while the command line is parsed,
/// writes what the program is to end with into exit_code, and throws IoError for input it cannot use.
void add_calibrate_command(CLI::App& app, int& exit_code);
void add_devices_command(CLI::App& app, int& exit_code);
void add_doctor_command(CLI::App& app, int& exit_code);
void add_eval_command(CLI::App& app, int& exit_code);
void add_map_command(CLI::App& app, int& exit_code);
void add_object_command(CLI::App& app, int& exit_code);
void add_record_command(CLI::App& app, int& exit_code);
void add_render_command(CLI::App& app, int& exit_code);
void add_run_command(CLI::App& app, int& exit_code);
void add_surface_command(CLI::App& app, int& exit_code);
void add_timing_command(CLI::App& app, int& exit_code);
void add_view_command(CLI::App& app, int& exit_code);

}  // namespace twofold
