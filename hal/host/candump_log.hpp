/// CAN logs in the format of `candump -L`, one frame a line:
///
///     (0000000000.100000) vcan0 400#0123456789ABCD
///
/// can-utils' log2asc, canplayer and others read it too.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

#include "hal/contract/can_port.hpp"
#include "hal/contract/clock.hpp"
#include "hal/host/opened.hpp"

namespace hal {

class CandumpWriter {
  public:
    /// Starts the file anew. Error: the path and the system's reason.
    static Opened<CandumpWriter> open(const std::string& path, std::string interface_name);

    void write(std::uint64_t time_us, const can::Frame& frame);
    /// Brings everything to the file. Empty if all lines ever written are there, else the reason.
    std::string flush();
    std::uint64_t lines() const { return lines_; }

  private:
    void note_failure();

    CandumpWriter(std::string path, std::string interface_name)
        : path_(std::move(path)), interface_(std::move(interface_name)), file_(path_) {}

    std::string path_;
    std::string interface_;
    std::ofstream file_;
    std::uint64_t lines_ = 0;
    std::string failure_;  ///< of the first write that failed
};

enum class CandumpKind : std::uint8_t {
    frame,     ///< standard data frame: the only kind that fills `frame`
    remote,    ///< RTR
    extended,  ///< 29 bit identifier
    error,     ///< error message of the controller
    fd,        ///< CAN FD
    garbage,   ///< not a line of such a log
};

struct CandumpLine {
    CandumpKind kind = CandumpKind::garbage;
    std::uint64_t time_us = 0;
    can::Frame frame = {};
};

/// One line, without its end. Tolerates blanks and carriage returns around it, lower case, six or nine
/// decimals and the direction flags newer versions append; everything else is garbage.
CandumpLine parse_candump_line(std::string_view text);

class CandumpReader {
  public:
    /// Error: the path and the system's reason.
    static Opened<CandumpReader> open(const std::string& path);

    /// The next line that is not blank. False: end of file.
    bool next(CandumpLine& line);
    /// Number of the line next() gave, from 1, and its text.
    std::uint64_t line_number() const { return line_number_; }
    const std::string& text() const { return text_; }

  private:
    explicit CandumpReader(std::ifstream file) : file_(std::move(file)) {}

    std::ifstream file_;
    std::string text_;
    std::uint64_t line_number_ = 0;
};

/// Any port, with everything sent and received written to a log.
class LoggingPort final : public CanPort {
  public:
    LoggingPort(CanPort& port, Clock& clock, CandumpWriter& log) : port_(port), clock_(clock), log_(log) {}

    bool send(const can::Frame& frame) override;
    bool receive(can::Frame& frame) override;
    void begin_cycle() override { port_.begin_cycle(); }
    CanState state() override { return port_.state(); }
    CanCounters counters() override { return port_.counters(); }

  private:
    CanPort& port_;
    Clock& clock_;
    CandumpWriter& log_;
};

}  // namespace hal
