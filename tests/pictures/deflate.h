// deflate.h: compression as PNG wants it, deflate (RFC 1951) in a zlib envelope (RFC 1950). It knows nothing of
// pictures.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

// The zlib stream of the data: one block of fixed or dynamic codes for each 32768 literals and matches.
std::vector<std::uint8_t> deflate(const std::vector<std::uint8_t>& data);

// The SIZE bytes that a zlib stream stands for, no more and no fewer. FAIL is called with the place in the stream where
// it is not as it must be and with what is wrong; it must throw. Allocates at most 1032 times the size of the stream.
std::vector<std::uint8_t> inflate(const std::vector<std::uint8_t>& stream, std::size_t size,
                                  const std::function<void(std::size_t at, const std::string& what)>& fail);
