#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/finished_run.hpp"
#include "apps/twofold/interrupt.hpp"
#include "apps/twofold/live_view.hpp"
#include "engine/clock.hpp"
#include "io/files/io_error.hpp"
#include "viewer/server.hpp"

namespace twofold {
namespace {

struct FileViewArguments {
  std::string path;
  ViewServerOptions server{.port = kUsualViewPort};
};

/// Until the program is interrupted.
void serve(const ViewServerOptions& options, const ViewScene& scene, const ViewTitle& title,
           KeyframeImages images) {
  std::unique_ptr<ViewServer> server;
  try {
    server = std::make_unique<ViewServer>(options, scene, title);
  } catch (const std::runtime_error& error) {
    throw IoError("view", error.what());
  }
  print_view_address(server->address(), server->is_open_to_network());
  catch_interrupts();
  std::stop_source stop;
  const auto watch = [&](const ViewServer::Audience& audience, ViewSight& newest) {
    images.answer(audience.keyframes, steady_now_ns(), newest);
    if (interrupted().load(std::memory_order_relaxed))
      stop.request_stop();  // relaxed: the flag carries no other data
  };
  server->run(stop.get_token(), watch, [] { return std::string("the program has ended"); });
}

void view(const FileViewArguments& arguments) {
  ViewScene scene;
  ViewTitle title;
  KeyframeImages::Find images;
  if (std::filesystem::is_directory(arguments.path)) {
    show_finished_run(arguments.path, scene, title);
    images = images_of_run(arguments.path);
    title.keyframe_images = static_cast<bool>(images);
  } else {
    show_map_file(arguments.path, scene, title);
  }
  serve(arguments.server, scene, title, KeyframeImages(std::move(images)));
}

}  // namespace

void add_view_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<FileViewArguments>();
  CLI::App* command = app.add_subcommand("view", "Show a map file or a finished run in a browser");
  command->add_option("PATH", arguments->path, "Map file (.tfm) or output folder of `twofold run`")
      ->required();
  command->add_option("--port", arguments->server.port, "Port to listen at; 0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command
      ->add_option("--bind", arguments->server.bind,
                   "Address to listen on: any but 127.0.0.1 shows it to the network")
      ->capture_default_str();
  command->callback([arguments, &exit_code] {
    view(*arguments);
    exit_code = kOk;
  });
}

}  // namespace twofold
