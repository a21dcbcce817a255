// Where monitors deliver their messages: an MLLP server for any number of them, in the clear or over TLS. It
// has one thread of its own; every function may be called from any other.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/attempt_guard.h"
#include "base/network_address.h"

namespace kiroku::recorder {

class MllpServer {
 public:
  struct Options {
    std::string address = "0.0.0.0";
    std::uint16_t port = 2575;  // 0: any that is free
    std::size_t longest_message = 512U << 10;
    /// In all, and of one address (of IPv6: one /64). One more takes the place of the idlest, first of those
    /// that delivered nothing yet (base/connection_places.h).
    std::size_t most_connections = 64, most_of_address = 16;
    /// Who may connect; empty: this machine, who has a certificate of `clients`, or with `allow_anybody`
    /// whoever reaches the port.
    std::vector<AddressRange> allowed;
    bool allow_anybody = false;
    /// A connection that is silent for so long is closed; so is one that stops within a message, sooner, or
    /// does not read what it is sent.
    std::chrono::seconds idle_limit = std::chrono::hours(1);
    std::chrono::seconds stall_limit = std::chrono::minutes(1);
    std::chrono::seconds handshake_limit{10};  // of TLS
    /// Over TLS, of an address that delivered no message yet: connections that bring none count as failures.
    /// Who has to wait is closed before the handshake.
    AttemptLimits handshakes{.free_failures = 16,
                             .first_wait = std::chrono::seconds(2),
                             .longest_wait = std::chrono::seconds(30),
                             .memory = std::chrono::minutes(10)};
    /// Of all such addresses of one IPv6 /64 together (recorder/vitals/handshake_pace.h).
    std::size_t network_handshakes_each_second = 20;
    /// PEM files; TLS (1.2 at least) if there is a certificate. With `clients` only who has a certificate
    /// issued by one of those is let in.
    std::string certificate, key, clients;
  };
  struct Answer {
    std::string text;  // "" for none
    /// The message is HL7 of somebody who may send here. Only that shows a connection to be a monitor's:
    /// whatever else is answered, anybody who reaches the port can send.
    bool is_to_sender = true;
  };
  /// Takes one message and says what to answer. Nothing where there is no room for it now: it
  /// is offered again a little later, and its connection read no further meanwhile. Called on the server's
  /// thread; what is answered is sent after it returned.
  using Taker = std::function<std::optional<Answer>(std::string_view message, const std::string& peer)>;
  /// What a person should know of a connection: name of the notice, sentence, peer. Ever fewer of the same
  /// name and address are told (base/tally.h): of peers who delivered no message yet from the second on, of
  /// others from the thousandth.
  using Complaint =
      std::function<void(const std::string& name, const std::string& text, const std::string& peer)>;

  /// Listens at once, so that a port that is taken is told now; monitors wait until start(). Throws
  /// kiroku::UsageError for an address that cannot be listened on, TLS files that cannot be used, and where
  /// the network reaches the address but nothing says who may connect.
  MllpServer(const Options& options, Taker taker, Complaint complaint);
  ~MllpServer();
  MllpServer(const MllpServer&) = delete;
  MllpServer& operator=(const MllpServer&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  /// Why options cannot be served because nothing says who may connect; "" where something does.
  [[nodiscard]] static std::string trust_problem(const Options& options);
  /// Connections that were refused: from addresses that may not connect or have to wait, or without a
  /// certificate.
  [[nodiscard]] std::uint64_t refused() const;
  /// Begins to serve; once.
  void start();
  /// Closes all connections and returns when nothing more will be taken. May be called more than once.
  void stop() noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::recorder
