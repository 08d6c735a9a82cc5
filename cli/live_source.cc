#include "cli/live_source.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "base/error.h"

namespace unfurl::cli {

namespace {

constexpr std::size_t kPiece = std::size_t{1}
                               << 18U;  // bytes read at once: 14 lines of four cameras

using Addresses = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

// "host:port", "[::1]:port".
std::pair<std::string, std::string> Parts(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  const std::string port = colon == std::string::npos ? "" : address.substr(colon + 1);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  const bool number = !port.empty() && port.size() <= 5 &&
                      port.find_first_not_of("0123456789") == std::string::npos &&
                      std::stoi(port) <= 65535;
  if (host.empty() || !number) {
    throw Error(fmt::format("'{}' is no address", address), "HOST:PORT",
                "give a host and a port, as in 127.0.0.1:5005");
  }
  return {host, port};
}

Addresses Resolve(const std::string& address, int flags) {
  const auto [host, port] = Parts(address);
  addrinfo hints = {};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = flags | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const int code = getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
  if (code != 0) {
    throw Error(fmt::format("the host is not known: {}", gai_strerror(code)), address,
                "give a host that this machine knows, as in 127.0.0.1:5005");
  }
  return {found, &freeaddrinfo};
}

// The address that a socket got.
std::string NameOf(int socket, const std::string& asked) {
  sockaddr_storage at = {};
  socklen_t size = sizeof at;
  char port[8] = {};
  if (getsockname(socket, reinterpret_cast<sockaddr*>(&at), &size) != 0 ||
      getnameinfo(reinterpret_cast<sockaddr*>(&at), size, nullptr, 0, port, sizeof port,
                  NI_NUMERICSERV) != 0) {
    return asked;
  }
  return asked.substr(0, asked.rfind(':') + 1) + port;
}

}  // namespace

LiveSource::LiveSource() : where_("standard input"), data_(STDIN_FILENO), buffer_(kPiece) {
  if (isatty(STDIN_FILENO) != 0) {
    throw Error("is a terminal, not a recorder", where_,
                "pipe a stream into it (unfurl stream), or give --listen HOST:PORT");
  }
}

LiveSource::LiveSource(const std::string& address) : buffer_(kPiece) {
  const Addresses found = Resolve(address, AI_PASSIVE);
  std::string problem;
  for (const addrinfo* at = found.get(); at != nullptr && listen_ < 0; at = at->ai_next) {
    const int made = socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int yes = 1;
    if (made >= 0) setsockopt(made, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (made >= 0 && bind(made, at->ai_addr, at->ai_addrlen) == 0 && listen(made, 1) == 0) {
      listen_ = made;
    } else {
      problem = std::strerror(errno);
      if (made >= 0) close(made);
    }
  }
  if (listen_ < 0) {
    throw Error(fmt::format("cannot be listened at: {}", problem), address,
                "choose another port; 0 takes a free one");
  }
  where_ = NameOf(listen_, address);
}

LiveSource::~LiveSource() {
  if (listen_ >= 0) close(listen_);
  if (data_ > STDIN_FILENO) close(data_);
}

LiveSource::Got LiveSource::Read(int wait_ms, std::string_view* bytes) {
  pollfd ready = {data_ >= 0 ? data_ : listen_, POLLIN, 0};
  if (poll(&ready, 1, wait_ms) <= 0) return Got::kNothing;
  if (data_ < 0) {
    const int client = accept4(listen_, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) return Got::kNothing;  // it left before it was let in
    data_ = client;
    close(listen_);
    listen_ = -1;
    return Got::kNothing;
  }
  const ssize_t n = read(data_, buffer_.data(), buffer_.size());
  if (n < 0 && (errno == EINTR || errno == EAGAIN)) return Got::kNothing;
  if (n < 0) {
    throw Error(fmt::format("the line broke: {}", std::strerror(errno)), where_,
                "see what became of the recorder");
  }
  *bytes = {buffer_.data(), static_cast<std::size_t>(n)};
  return n == 0 ? Got::kEnd : Got::kBytes;
}

int ConnectTo(const std::string& address) {
  const Addresses found = Resolve(address, 0);
  std::string problem;
  for (const addrinfo* at = found.get(); at != nullptr; at = at->ai_next) {
    const int made = socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC, 0);
    if (made >= 0 && connect(made, at->ai_addr, at->ai_addrlen) == 0) {
      const int yes = 1;  // a line waits for no other
      setsockopt(made, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
      return made;
    }
    problem = std::strerror(errno);
    if (made >= 0) close(made);
  }
  throw Error(fmt::format("nobody listens there: {}", problem), address,
              "start unfurl reconstruct --live --listen there; it takes one client");
}

}  // namespace unfurl::cli
