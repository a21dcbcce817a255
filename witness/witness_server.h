// The HTTP front of a witness (C2SP tlog-witness.md): POST add-checkpoint, GET <origin hash>/checkpoint.
// Without TLS: what is answered is signed, and what is asked is judged by the log's signature alone.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "witness/witness.h"

namespace kiroku::witness {

/// Listens from construction to destruction on its own threads. `witness` must outlive it.
class WitnessServer {
 public:
  /// `listen` is "address:port" ("[::1]:port"); port 0 takes a free one. A request of more than 64 KiB is
  /// refused; it must arrive, and its answer leave, within `time_limit` each. Up to 64 connections, 16 of one
  /// address (of IPv6: one /64); the idlest makes room. Throws kiroku::Error if it cannot listen there.
  WitnessServer(Witness& witness, const std::string& listen,
                std::chrono::milliseconds time_limit = std::chrono::seconds(10));
  ~WitnessServer();
  [[nodiscard]] std::uint16_t port() const;
  [[nodiscard]] std::string url() const;  // "http://127.0.0.1:3171/": its submission prefix

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::witness
