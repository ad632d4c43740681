// Takes a seat through `race gateway` and drives a race: driver "ADDRESS" [NAME]

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iomanip>
#include <optional>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/property_tree/json_parser.hpp>
#include <boost/property_tree/ptree.hpp>

#include "drive_generated.h"
#include "pursuit.hpp"

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
namespace codes = race::codes;
using Json = boost::property_tree::ptree;

constexpr int snapshots_hz = 60;  // each is answered with a control
// A button acts when it goes down, so it is pressed and released in turn.
constexpr std::uint32_t press_ticks = 6;

// The address for drivers that `race gateway --drivers 1` prints.
struct Address {
  std::string host, port, token;
};

Address read_address(const std::string& text) {
  static const std::regex form(R"(http://([^/:]+):(\d+)/#drive&token=([\w-]+))");
  std::smatch found;
  if (!std::regex_match(text, found, form)) {
    throw std::runtime_error(
        "the address is not http://HOST:PORT/#drive&token=TOKEN; pass all of it, in quotes");
  }
  return {found[1], found[2], found[3]};
}

// A WebSocket to the gateway, read and written in turn.
class Channel {
 public:
  explicit Channel(const Address& address) : socket_(context_) {
    asio::ip::tcp::resolver resolver(context_);
    asio::connect(socket_.next_layer(), resolver.resolve(address.host, address.port));
    socket_.next_layer().set_option(asio::ip::tcp::no_delay(true));
    socket_.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
      request.set(beast::http::field::sec_websocket_protocol, "race.1");
    }));
    socket_.handshake(address.host + ":" + address.port, "/ws");
  }

  void send(const std::string& words) {
    socket_.text(true);
    socket_.write(asio::buffer(words));
  }

  void send(const flatbuffers::FlatBufferBuilder& message) {
    socket_.binary(true);
    socket_.write(asio::buffer(message.GetBufferPointer(), message.GetSize()));
  }

  // Returns the next message, and whether it is text.
  std::pair<std::string, bool> receive() {
    beast::flat_buffer buffer;
    socket_.read(buffer);
    return {beast::buffers_to_string(buffer.data()), socket_.got_text()};
  }

  void close() { socket_.close(websocket::close_code::normal); }

 private:
  asio::io_context context_;
  websocket::stream<asio::ip::tcp::socket> socket_;
};

// Returns the table in a message, nullptr if it is of another kind or damaged.
template <typename Table>
const Table* table_in(const std::string& message, const char* identifier) {
  const auto* data = reinterpret_cast<const std::uint8_t*>(message.data());
  flatbuffers::Verifier verifier(data, message.size());
  const bool is_it = message.size() >= 8 && flatbuffers::BufferHasIdentifier(data, identifier) &&
                     verifier.VerifyBuffer<Table>(identifier);
  return is_it ? flatbuffers::GetRoot<Table>(data) : nullptr;
}

double seconds(std::int64_t microseconds) { return 1e-6 * static_cast<double>(microseconds); }

class Driver {
 public:
  Driver(const Address& address, const std::string& name) : channel_(address) {
    std::ostringstream hello;
    hello << R"({"role": "drive", "token": ")" << address.token << R"(", "name": )"
          << std::quoted(name) << R"(, "rate": )" << snapshots_hz << "}";
    channel_.send(hello.str());
  }

  // Drives until the race is over for this kart, and returns whether it finished.
  bool drive() {
    while (!outcome_) {
      const auto [message, is_text] = channel_.receive();
      if (is_text) {
        receive_text(message);
      } else {
        receive_message(message);
      }
    }
    channel_.close();
    return *outcome_;
  }

 private:
  void receive_text(const std::string& text) {
    Json words;
    std::istringstream stream(text);
    boost::property_tree::read_json(stream, words);
    const auto type = words.get<std::string>("type");
    const auto reason = words.get<std::string>("reason", "");
    if (type == "welcome") {
      seat_ = words.get<int>("seat");
      sequence_ = words.get<std::uint32_t>("sequence");
      std::printf("seat %d of session %s\n", seat_, words.get<std::string>("session").c_str());
    } else if (type == "refused") {
      throw std::runtime_error("refused: " + reason);
    } else if (type == "ready" && !words.get<bool>("accepted")) {
      throw std::runtime_error("not accepted as ready: " + reason);
    } else if (type == "notice" && !reason.empty()) {
      std::printf("%s\n", reason.c_str());
    }
  }

  void receive_message(const std::string& message) {
    if (const auto* snapshot = table_in<race::spectate::Snapshot>(message, "RSNP")) {
      answer(*snapshot);
    } else if (const auto* hud = table_in<race::drive::Hud>(message, "RHUD")) {
      epoch_ = hud->epoch();
      item_ = hud->item();
      limits_ = {hud->speed_cap(), hud->grip_scale()};
    } else if (const auto* events = table_in<race::spectate::Events>(message, "REVT")) {
      show_laps(*events);
    } else if (const auto* standings = table_in<race::spectate::Standings>(message, "RSTD")) {
      show_result(*standings);
    } else if (table_in<race::session::Course>(message, "RCRS") != nullptr) {
      course_ = message;
    } else if (table_in<race::session::Line>(message, "RLIN") != nullptr) {
      line_ = message;
    } else if (const auto* briefing = table_in<race::session::Briefing>(message, "RBRF")) {
      get_ready(*briefing);
    }
  }

  // The briefing comes after course and line.
  void get_ready(const race::session::Briefing& briefing) {
    const auto* course = table_in<race::session::Course>(course_, "RCRS");
    const auto* line = table_in<race::session::Line>(line_, "RLIN");
    if (course == nullptr || line == nullptr || line->x()->size() == 0) {
      throw std::runtime_error(
          "this race has no reference line, and this driver needs one");
    }
    pursuit_.emplace(briefing, *course, *line);
    std::printf("%u laps of %s; the reference line's lap takes %.2f s\n", briefing.laps(),
                course->name()->c_str(), line->lap());
    if (line->note()->size() > 0) {
      std::printf("%s\n", line->note()->c_str());
    }
    channel_.send(R"({"type": "ready", "ready": true})");
  }

  void answer(const race::spectate::Snapshot& snapshot) {
    const auto& karts = *snapshot.karts();
    const auto kart = std::find_if(karts.begin(), karts.end(),
                                   [&](const auto* one) { return one->seat() == seat_; });
    if (!pursuit_ || kart == karts.end() || epoch_ != snapshot.epoch()) {
      return;
    }
    const bool is_on = snapshot.phase() == codes::Phase_RUNNING && snapshot.lights() == 0.0f;
    const Wishes wishes = is_on ? pursuit_->decide(**kart, karts, limits_) : Wishes{};
    const bool presses = snapshot.tick() / press_ticks % 2 == 0;
    const bool uses_item = is_on && presses && item_ != 0;
    const bool is_stuck = ((*kart)->flags() & codes::KartFlag_RESCUE_OFFERED) != 0;
    const int buttons = (uses_item ? codes::Button_USE_ITEM : codes::Button_NONE) |
                        (is_stuck ? codes::Button_ACCEPT_RESCUE : codes::Button_NONE);
    sequence_ = std::max(sequence_, (*kart)->acknowledged()) + 1;
    // The gateway sets `epoch` and `tick`.
    const race::drive::Control control(0, sequence_, 0, static_cast<float>(wishes.steering),
                                       static_cast<float>(wishes.throttle),
                                       static_cast<float>(wishes.brake),
                                       static_cast<codes::Button>(buttons));
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(race::drive::CreateControlMessage(builder, &control), "RCTL");
    channel_.send(builder);
  }

  void show_laps(const race::spectate::Events& events) {
    for (const auto* event : *events.events()) {
      if (events.epoch() == epoch_ && event->kind() == codes::EventKind_LAP && event->kart() == seat_) {
        std::printf("lap %d: %.3f s\n", event->other(), seconds(event->value()));
      }
    }
  }

  void show_result(const race::spectate::Standings& standings) {
    for (const auto* row : *standings.rows()) {
      if (standings.epoch() != epoch_ || row->seat() != seat_) {
        continue;
      }
      if (row->status() == codes::Status_FINISHED) {
        std::printf("finished in %.3f s, place %d of %u\n", seconds(row->race_time_us()),
                    row->rank(), standings.rows()->size());
        outcome_ = true;
      } else if (row->status() == codes::Status_RETIRED) {
        std::printf("out of the race after %u laps\n", row->laps());
        outcome_ = false;
      }
    }
  }

  Channel channel_;
  int seat_ = -1;
  std::uint32_t sequence_ = 0;
  std::optional<std::uint32_t> epoch_;  // of this kart's race, once it has begun
  int item_ = 0;
  Limits limits_;
  std::string course_, line_;  // messages
  std::optional<Pursuit> pursuit_;
  std::optional<bool> outcome_;
};

}  // namespace

int main(int count, char** words) {
  if (count < 2 || count > 3) {
    std::fprintf(stderr, "usage: %s \"ADDRESS\" [NAME]\n", words[0]);
    return 2;
  }
  std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ);
  try {
    Driver driver(read_address(words[1]), count == 3 ? words[2] : "C++");
    return driver.drive() ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  }
}
