/**
 * @file Recorder.hpp
 * Rows of a test from the control loop to a file, through a ring that one thread fills and another empties.
 */

#pragma once

#include <px4_platform_common/atomic.h>
#include <stdio.h>

struct Row {
	double time_s;
	float input;
	float value;
	float rate;
	int phase;
};

class Recorder
{
public:
	~Recorder() { close(); }

	/** Opens the file. Not for a realtime thread. */
	bool open(const char *path);

	/** From the control loop: takes a row, or drops it if the ring is full. */
	void push(const Row &row);

	/** Writes what has come. Not for a realtime thread. */
	void flush();
	void close();

private:
	static constexpr unsigned SIZE = 256;
	Row _rows[SIZE] {};
	px4::atomic<unsigned> _pushed{0};
	px4::atomic<unsigned> _written{0};
	FILE *_file{nullptr};
};
