// Serving a page from a terminal or as a service, until it is told to end: what its commands have in common.
// Functions.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "apps/common/command_line.h"
#include "apps/kiroku/home.h"
#include "viewer/viewer.h"

namespace kiroku::apps {

/// What every command that serves a page takes.
struct ServingRequest {
  std::string listen;         // "": behind the viewer of the home alone
  std::string own_port = {};  // of an example, where it needs no address of its own: "8445"
  std::optional<std::string> home = {}, certificate = {}, key = {}, web = {};
  bool json = false;
};
/// `request` has the address to listen on by default, or `own_port`, and must live as long as the command.
void add_serving_options(Command& command, ServingRequest& request);

/// The folder that was named, or the page as it is built or installed; nothing: neither.
std::optional<std::filesystem::path> page_of(const ServingRequest& request);

/// What one of them serves.
struct Served {
  std::string serves;                      // of viewer::ViewerHome
  viewer::Session::Identities identities;  // null: everybody brings their own
  std::function<void(viewer::Router& router, viewer::ViewerContext& context)> more_routes;
  std::function<void(const std::string& sentence)> tell;
  /// What is said once it serves: a line for people, and what JSON has beside address and fingerprint.
  std::function<std::string(const std::string& url)> first_line;  // `url` is "" behind the viewer alone
  std::function<void(nlohmann::ordered_json& told)> tell_more;
  /// Changes what is served; empty: it is the home's own.
  std::function<void(viewer::ViewerHome& of_viewer)> change_home = {};
};

/// One sentence a line on standard error. What is returned is thread-safe.
std::function<void(const std::string&)> tell_on_standard_error();

/// Serves until SIGINT or SIGTERM, then brings what runs to its end unless a second signal comes. Says where,
/// with the address that signs in once without a password for a demonstration's home on a loopback address.
/// By the main thread, before it has started others.
void serve_until_stopped(const ServingRequest& request, const Home& home, Served served);

}  // namespace kiroku::apps
