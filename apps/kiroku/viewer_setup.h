// What serving the viewer of a home takes, for `kiroku view` and kirokud. Functions; thread-safe.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "viewer/api/viewer_context.h"
#include "viewer/http/server_certificate.h"

namespace kiroku::apps {

/// Where the page's files are, as it is built, or installed; nothing: neither.
std::optional<std::filesystem::path> find_page();

/// kiroku-full, as it is built, or installed; empty: neither.
std::filesystem::path find_full_program();

/// The certificate and key of these files, or where there are none the home's own, made if it is not there,
/// also for the host of `listen`. kiroku::UsageError where only one is named.
viewer::ServerCertificate viewer_certificate(const Home& home, const std::string& listen,
                                             const std::optional<std::string>& certificate,
                                             const std::optional<std::string>& key);

/// Identities that were named, or a demonstration's; null: everybody brings their own.
viewer::Session::Identities shared_identities(const std::vector<std::string>& files, const Home& home);

/// What is pointed to must outlive the viewer.
viewer::ViewerHome viewer_home(const Home& home, const Configuration& configuration,
                               const crypto::SigningKey& device_key, const timestamp::TrustStore& trust,
                               viewer::Session::Identities identities);

}  // namespace kiroku::apps
