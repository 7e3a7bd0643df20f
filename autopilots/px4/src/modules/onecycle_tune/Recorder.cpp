#include "Recorder.hpp"

bool Recorder::open(const char *path)
{
	close();
	_file = fopen(path, "w");

	if (!_file) {
		return false;
	}

	_written.store(_pushed.load());
	return fprintf(_file, "time_s,u,y,rate,phase\n") > 0;
}

void Recorder::push(const Row &row)
{
	const unsigned pushed = _pushed.load();

	if (pushed - _written.load() < SIZE) {
		_rows[pushed % SIZE] = row;
		_pushed.store(pushed + 1);
	}
}

void Recorder::flush()
{
	unsigned written = _written.load();

	while (_file && written != _pushed.load()) {
		const Row &row = _rows[written % SIZE];
		fprintf(_file, "%.6f,%.7g,%.8g,%.7g,%d\n", row.time_s, (double)row.input, (double)row.value, (double)row.rate,
			row.phase);
		_written.store(++written);
	}
}

void Recorder::close()
{
	if (_file) {
		flush();
		fclose(_file);
		_file = nullptr;
	}
}
