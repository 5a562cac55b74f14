#include "host_sim/dbc_writer.hpp"

#include <cstdint>
#include <sstream>
#include <vector>

#include "can/signals.hpp"

namespace sim {
namespace {

/// value / 10^decimals without a rounding or a trailing zero.
std::string decimal(std::int64_t value, int decimals) {
    std::string digits = std::to_string(value < 0 ? -value : value);
    if (decimals > 0) {
        const auto places = static_cast<std::size_t>(decimals);
        if (digits.size() <= places) digits.insert(0, places + 1 - digits.size(), '0');
        digits.insert(digits.size() - places, ".");
        digits.erase(digits.find_last_not_of('0') + 1);
        if (digits.back() == '.') digits.pop_back();
    }
    return value < 0 ? "-" + digits : digits;
}

struct NumberedMessage {
    const can::Message& layout;
    unsigned id;
    std::string name;
};

std::vector<NumberedMessage> numbered_messages() {
    std::vector<NumberedMessage> all;
    for (const can::Message* message : can::kMessages) {
        for (unsigned i = 0; i < message->count; ++i) {
            std::string name(message->name);
            if (message->count > 1)
                name += {static_cast<char>('0' + i / 10), static_cast<char>('0' + i % 10)};
            all.push_back({*message, message->id + i, name});
        }
    }
    return all;
}

void write_signal(std::ostream& out, const can::Signal& signal, std::string_view receivers) {
    const auto physical = [&signal](std::int64_t count) {
        return decimal(count * signal.step, signal.decimals);
    };
    out << " SG_ " << signal.name << " : " << int{signal.start} << '|' << int{signal.length} << "@1"
        << (signal.is_signed ? '-' : '+') << " (" << physical(1) << ",0) [" << physical(signal.min) << '|'
        << physical(signal.max) << "] \"" << signal.unit << "\" " << receivers << '\n';
}

/// The comment of a signal, with what its ends mean.
std::string described(const can::Signal& signal) {
    std::string text(signal.comment);
    if (signal.or_more) text += ". The greatest value stands for all above it";
    return text;
}

}  // namespace

std::string dbc_text() {
    const std::vector<NumberedMessage> messages = numbered_messages();
    std::ostringstream out;
    out << "VERSION \"" << int{can::Version{}.protocol} << "\"\n\n";
    out << "NS_ :\n\tCM_\n\tBA_DEF_\n\tBA_\n\tVAL_\n\tBA_DEF_DEF_\n\n";
    out << "BS_:\n\n";
    out << "BU_: Radar Ecu Driver\n\n";

    for (const NumberedMessage& message : messages) {
        out << "BO_ " << message.id << ' ' << message.name << ": " << int{message.layout.length} << ' '
            << message.layout.sender << '\n';
        for (const can::Signal* signal : message.layout.signals)
            write_signal(out, *signal, message.layout.receivers);
        out << '\n';
    }

    out << "CM_ \"77 GHz FMCW radar. Written by radar_monitor --write-dbc from can/signals.hpp; Intel byte "
           "order, "
           "E2E profile 11 in every message.\";\n"
        << "CM_ BU_ Radar \"The radar.\";\n"
        << "CM_ BU_ Ecu \"The car: tells its own motion, uses the objects.\";\n"
        << "CM_ BU_ Driver \"Display and operating unit: shows warnings, sends commands.\";\n";
    for (const NumberedMessage& message : messages) {
        out << "CM_ BO_ " << message.id << " \"" << message.layout.comment << ".\";\n";
        for (const can::Signal* signal : message.layout.signals)
            out << "CM_ SG_ " << message.id << ' ' << signal->name << " \"" << described(*signal) << ".\";\n";
    }

    out << "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\n"
        << "BA_DEF_ BO_ \"E2EDataId\" INT 0 65535;\n"
        << "BA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n"
        << "BA_DEF_DEF_ \"E2EDataId\" 0;\n";
    for (const NumberedMessage& message : messages) {
        if (message.layout.period_ms > 0)
            out << "BA_ \"GenMsgCycleTime\" BO_ " << message.id << ' ' << message.layout.period_ms << ";\n";
        out << "BA_ \"E2EDataId\" BO_ " << message.id << ' ' << message.id << ";\n";
    }
    for (const NumberedMessage& message : messages) {
        for (const can::Signal* signal : message.layout.signals) {
            if (signal->values.empty()) continue;
            out << "VAL_ " << message.id << ' ' << signal->name;
            for (const can::ValueName& value : signal->values)
                out << ' ' << value.raw << " \"" << value.name << '"';
            out << " ;\n";
        }
    }
    return out.str();
}

}  // namespace sim
