/// Instruction counts of single pieces of the firmware. Every image that includes this prints lines
/// `bench NAME INSTRUCTIONS` and `bytes NAME BYTES`, which toolchains/target_report.py reads.
#pragma once

#include <concepts>
#include <cstdint>
#include <string_view>

#include "firmware/text_line.hpp"
#include "hal/common/uart_console.hpp"
#include "target_board.hpp"
#include "tests/target/patient_uart.hpp"

namespace target {

inline PatientUart patient_uart(uart);
inline hal::UartConsole figures(patient_uart);

inline void start_bench() {
    start_uart();
    start_counting();
}

inline void print_figure(std::string_view kind, std::string_view name, std::uint32_t value) {
    firmware::TextLine line;
    line.text(kind).text(" ").text(name).text(" ").number(value);
    figures.line(line.view());
}

/// Mean of `repeats` calls work(i), i from 0, printed under `name`. The call and the loop, some five
/// instructions, count too. The boards' counters have a grain of up to 40 instructions: with 64 repeats the
/// figure is exact to one.
template <std::invocable<std::uint32_t> Work>
void measure(std::string_view name, std::uint32_t repeats, Work work) {
    const std::uint32_t begin = instructions();
    for (std::uint32_t i = 0; i < repeats; ++i) {
        work(i);
        asm volatile("" ::: "memory");
    }
    const std::uint32_t total = instructions() - begin;
    print_figure("bench", name, (total + repeats / 2) / repeats);
}

}  // namespace target
