-- Modbus on a FANUC controller, as fanuc-hmi-modbus.md describes it: Wireshark's own dissector of Modbus, and what it does not
-- have: the robot's signals, the telemetry block, corruption within a stream.
--
-- Copy this file into Wireshark's folder of personal Lua plugins. Then "Decode As" of a TCP port: 502 is Modbus's own.

local modbus = Proto("fanuc_hmi_modbus", "FANUC HMI Modbus")
local EXCEPTION, MAX_RTU = 0x80, 256

modbus.prefs.framing = Pref.enum("Framing", 1, "MBAP headers, or RTU frames through TCP", { { 1, "tcp", 1 }, { 2, "rtu", 2 } }, false)
modbus.prefs.word_order = Pref.enum("Word order", 1, "Which register of a 32-bit value comes first",
    { { 1, "low_first", 1 }, { 2, "high_first", 2 } }, false)

local f = modbus.fields
local function number(name, label, kind) f[name] = kind("fanuc_hmi_modbus." .. name, label, base.DEC) end
number("transaction", "Transaction", ProtoField.uint16)
number("unit", "Unit", ProtoField.uint8)
local FUNCTIONS = {
    [1] = "read coils", [2] = "read discrete inputs", [3] = "read holding registers", [4] = "read input registers",
    [5] = "write coil", [6] = "write register", [15] = "write coils", [16] = "write registers",
    [7] = "read exception status", [8] = "diagnostics", [11] = "get comm event counter", [12] = "get comm event log",
    [20] = "read file record", [21] = "write file record", [24] = "read FIFO queue",
    [17] = "report server id", [22] = "mask write register", [23] = "read/write registers",
    [43] = "read device identification",
}
f.function_code = ProtoField.uint8("fanuc_hmi_modbus.function", "Function", base.DEC, FUNCTIONS)
number("address", "Address", ProtoField.uint16)
number("quantity", "Quantity", ProtoField.uint16)
number("write_address", "Write address", ProtoField.uint16)
number("value", "Value", ProtoField.uint16)
number("values", "Value", ProtoField.uint16)
number("bits", "Bit", ProtoField.uint8)
number("registers", "Register", ProtoField.uint16)
number("and", "AND mask", ProtoField.uint16)
number("or", "OR mask", ProtoField.uint16)
number("data", "Data", ProtoField.uint8)
number("subfunction", "Subfunction", ProtoField.uint16)
number("status", "Status", ProtoField.uint16)
number("events", "Events", ProtoField.uint16)
number("messages", "Messages", ProtoField.uint16)
number("log", "Event", ProtoField.uint8)
number("contents", "Register", ProtoField.uint16)
number("file", "File", ProtoField.uint16)
number("record", "Record", ProtoField.uint16)
number("id", "Id", ProtoField.uint8)
number("category", "Category", ProtoField.uint8)
number("object", "Object", ProtoField.uint8)
number("conformity", "Conformity", ProtoField.uint8)
number("more", "More follows", ProtoField.uint8)
number("next", "Next object", ProtoField.uint8)
f.text = ProtoField.string("fanuc_hmi_modbus.text", "Text")
f.exception = ProtoField.uint8("fanuc_hmi_modbus.exception", "Exception", base.DEC, {
    [1] = "illegal function", [2] = "illegal data address", [3] = "illegal data value", [4] = "server device failure",
    [5] = "acknowledge", [6] = "server device busy", [8] = "memory parity error", [10] = "gateway path unavailable",
    [11] = "gateway target failed to respond",
})
f.signal = ProtoField.string("fanuc_hmi_modbus.signal", "Signal")
f.life_counter = ProtoField.uint32("fanuc_hmi_modbus.life_counter", "Life counter", base.DEC)
f.override = ProtoField.int16("fanuc_hmi_modbus.override", "Override, %", base.DEC)
local REALS = { "POS_X", "POS_Y", "POS_Z", "POS_W", "POS_P", "POS_R", "Q_1", "Q_2", "Q_3", "Q_4", "SPD_X", "SPD_Y", "SPD_Z",
    "SPD_Q1", "SPD_Q2", "SPD_Q3", "SPD_Q4" }
for _, name in ipairs(REALS) do f[name] = ProtoField.float("fanuc_hmi_modbus." .. name:lower(), name) end
f.decode_error = ProtoField.string("fanuc_hmi_modbus.decode_error", "Error")
f.request_in = ProtoField.framenum("fanuc_hmi_modbus.request_in", "Request in", base.NONE, frametype.REQUEST)
f.response_time = ProtoField.double("fanuc_hmi_modbus.response_time", "Response time in seconds")

local group, severity = expert.group, expert.severity
local function rule(name, text, kind, level) return ProtoExpert.new("fanuc_hmi_modbus." .. name, text, kind, level) end
local e = {
    crc = rule("bad_crc", "Bad CRC", group.CHECKSUM, severity.ERROR),
    header = rule("bad_header", "No header of Modbus TCP", group.MALFORMED, severity.ERROR),
    pdu = rule("bad_pdu", "A PDU that the specification does not allow", group.MALFORMED, severity.ERROR),
    refused = rule("refused", "Refused with an exception", group.RESPONSE_CODE, severity.NOTE),
    mismatch = rule("mismatch", "The reply does not answer its request", group.PROTOCOL, severity.ERROR),
    unasked = rule("unasked", "Reply without a request", group.SEQUENCE, severity.WARN),
    beyond = rule("beyond", "Beyond the last address", group.PROTOCOL, severity.WARN),
    not_used = rule("not_used", "An address that no signal has", group.PROTOCOL, severity.NOTE),
    impossible = rule("impossible", "Telemetry that cannot be", group.PROTOCOL, severity.WARN),
}
local experts = {}
for _, info in pairs(e) do table.insert(experts, info) end
modbus.experts = experts

-- Table 1: function of the table, PDU addresses, the number of the signal at the first.
local SIGNALS = {
    { 2, "DI", 0, 9999, 1 }, { 2, "RI", 10000, 19999, 1 }, { 2, "UI", 20000, 20999, 1 }, { 2, "UO", 21000, 21998, 1 },
    { 2, "SI", 21999, 22998, 0 }, { 2, "SO", 22999, 23999, 0 }, { 2, "WI", 24000, 24999, 1 }, { 2, "WO", 25000, 25999, 1 },
    { 2, "WSI", 26000, 26999, 1 }, { 2, "WSO", 27000, 27999, 1 },
    { 1, "DO", 0, 9999, 1 }, { 1, "RO", 10000, 19999, 1 }, { 1, "F", 20000, 29999, 1 },
    { 4, "GI", 0, 999, 1 }, { 4, "GO", 1000, 1999, 1 }, { 4, "AI", 2000, 2999, 1 }, { 4, "AO", 3000, 3999, 1 },
    { 3, "R", 0, 16383, 1 }, { 3, "Dynamic", 16384, 16447, 0 },
}
local TABLE_OF = { [1] = 1, [5] = 1, [15] = 1, [2] = 2, [3] = 3, [6] = 3, [16] = 3, [22] = 3, [23] = 3, [4] = 4 }
local MAX_QUANTITY = { [1] = 2000, [2] = 2000, [3] = 125, [4] = 125, [15] = 1968, [16] = 123, [23] = 125 }

local stream_field = Field.new("tcp.stream")
local open_requests, matches = {}, {}

function modbus.init()
    open_requests, matches = {}, {}
end

-- Functions whose requests have nothing else.
local BARE = { [7] = true, [11] = true, [12] = true, [17] = true }
local NAMED = { [7] = true, [8] = true, [11] = true, [12] = true, [17] = true, [20] = true, [21] = true, [24] = true, [43] = true }
for code in pairs(TABLE_OF) do NAMED[code] = true end

local function is_identification(pdu) return pdu:len() > 1 and pdu(0, 1):uint() == 43 and pdu(1, 1):uint() == 14 end

local function is_read(code) return code >= 1 and code <= 4 or code == 23 end

local function crc16(range)
    local crc = 0xFFFF
    for at = 0, range:len() - 1 do
        crc = bit.bxor(crc, range(at, 1):uint())
        for _ = 1, 8 do
            local odd = bit.band(crc, 1) == 1
            crc = bit.rshift(crc, 1)
            if odd then crc = bit.bxor(crc, 0xA001) end
        end
    end
    return crc
end

--- The length of the RTU frame that begins at `at`: nil if it takes more bytes to know, false if only a silence shows it.
local function rtu_length(tvb, at, is_request)
    local left = tvb:len() - at
    if left < 2 then return nil end
    local code = tvb(at + 1, 1):uint()
    local function counted(place)
        if left <= place then return nil end
        return place + 3 + tvb(at + place, 1):uint()
    end
    if code == 22 then return 10 end
    if code == 20 or code == 21 then return counted(2) end
    if is_request then
        if code >= 1 and code <= 6 then return 8 end
        if BARE[code] then return 4 end
        if code == 24 then return 6 end
        if code == 15 or code == 16 then return counted(6) end
        if code == 23 then return counted(10) end
    else
        if is_read(code) or code == 12 or code == 17 then return counted(2) end
        if code == 7 then return 5 end
        if code == 24 then return counted(3) end
        if code == 11 or code == 5 or code == 6 or code == 15 or code == 16 then return 8 end
        if code > EXCEPTION then return 5 end
    end
    return false
end

--- Reads a PDU, and gives each part to `add`; raises the error of one that is none. Returns the function, and what it asks for.
local function read_pdu(pdu, is_request, add)
    local at = 0
    local function fail(kind) error({ kind = kind }) end
    local function take(size)
        if at + size > pdu:len() then fail("pdu_length") end
        at = at + size
        return pdu(at - size, size)
    end
    local function exactly(size)
        if pdu:len() ~= size then fail("pdu_length") end
    end
    local function word(name)
        local range = take(2)
        if name then add(f[name], range) end
        return range:uint()
    end
    local function quantity(max, name)
        local found = word(name)
        if found < 1 or found > max then fail("quantity") end
        return found
    end
    local function rest_words(name)
        while at < pdu:len() do word(name) end
    end
    local function rest_bits(name, count)
        local from = at
        for index = 0, count - 1 do
            local range = pdu(from + math.floor(index / 8), 1)
            add(f[name], range, bit.band(bit.rshift(range:uint(), index % 8), 1))
        end
    end

    local range = take(1)
    local code = range:uint()
    if code == 0 or code == EXCEPTION or is_request and code > EXCEPTION then fail("function") end
    add(f.function_code, range, code % EXCEPTION)
    local asked = { code = code % EXCEPTION }
    if code > EXCEPTION then
        exactly(2)
        range = take(1)
        add(f.exception, range)
        asked.exception = range:uint()
    elseif code == 8 then
        exactly(math.max(5, pdu:len() + (pdu:len() + 1) % 2))
        word("subfunction")
        rest_words("values")
    elseif BARE[code] and is_request then
        exactly(1)
    elseif code == 7 then
        exactly(2)
        add(f.status, take(1))
    elseif code == 11 then
        exactly(5)
        word("status")
        word("events")
    elseif code == 12 then
        local count = take(1):uint()
        if count < 1 or count > 70 then fail("reply_byte_count") end
        exactly(2 + count)
        if count < 6 then fail("reply_byte_count") end
        word("status")
        word("events")
        word("messages")
        while at < pdu:len() do add(f.log, take(1)) end
    elseif code == 20 or code == 21 then
        local is_contents = code == 20 and not is_request
        local around, left = code == 20 and 2 or 7, code == 20 and 245 or 251
        exactly(2 + take(1):uint())
        repeat
            local run = pdu(at)
            local size, found
            if is_contents then
                if run:len() < 2 then fail("pdu_length") end
                size = math.max(run(0, 1):uint(), 1) + 1
                found = math.floor((size - 2) / 2)
            else
                if run:len() < 7 then fail("pdu_length") end
                found = run(5, 2):uint()
                size = 7 + (code == 21 and 2 * found or 0)
            end
            if run:len() < size then fail("pdu_length") end
            if run(is_contents and 1 or 0, 1):uint() ~= 6 then fail("reference_type") end
            if is_contents and size % 2 == 1 then fail("reply_byte_count") end
            if found < 1 or found > math.floor(math.max(left - around, 0) / 2) then fail("quantity") end
            left = left - around - 2 * found
            if is_contents then
                take(2)
            else
                take(1)
                word("file")
                word("record")
                word(code == 20 and "quantity" or nil)
            end
            if is_contents or code == 21 then
                for _ = 1, found do word(is_contents and "contents" or "values") end
            end
        until at >= pdu:len()
    elseif code == 24 and is_request then
        exactly(3)
        asked.address = word("address")
    elseif code == 24 then
        if pdu:len() < 5 then fail("pdu_length") end
        local size, count = word(), word()
        if count > 31 then fail("quantity") end
        if size ~= 2 + 2 * count then fail("byte_count") end
        exactly(3 + size)
        rest_words("registers")
    elseif code == 17 then
        local count = take(1):uint()
        if count < 1 or count > 250 then fail("reply_byte_count") end
        exactly(2 + count)
        while at < pdu:len() do add(f.id, take(1)) end
    elseif is_identification(pdu) then
        take(1)
        if is_request then exactly(4) elseif pdu:len() < 7 then fail("pdu_length") end
        add(f.category, take(1))
        if is_request then
            add(f.object, take(1))
        else
            add(f.conformity, take(1))
            local more = take(1)
            if more:uint() ~= 0 and more:uint() ~= 0xFF then fail("more_follows") end
            add(f.more, more, more:uint() % 254)
            add(f.next, take(1))
            for _ = 1, take(1):uint() do
                local id, size = take(1), take(1):uint()
                add(f.id, id)
                local text = take(size)
                if size > 0 then add(f.text, text, text:string(ENC_ISO_8859_1)) end
            end
            exactly(at)
        end
    elseif not TABLE_OF[code] then
        while at < pdu:len() do add(f.data, take(1)) end
    elseif not is_request and is_read(code) then
        local count = take(1):uint()
        if code > 2 and count % 2 == 1 or count < 1 or count > 250 then fail("reply_byte_count") end
        exactly(2 + count)
        asked.bytes = count
        if code <= 2 then rest_bits("bits", 8 * count) else rest_words("registers") end
    elseif code <= 4 then
        exactly(5)
        asked.address = word("address")
        asked.quantity = quantity(MAX_QUANTITY[code], "quantity")
    elseif code == 5 then
        exactly(5)
        asked.address = word("address")
        range = take(2)
        if range:uint() ~= 0xFF00 and range:uint() ~= 0 then fail("coil_value") end
        add(f.value, range, range:uint() == 0 and 0 or 1)
    elseif code == 6 then
        exactly(5)
        asked.address = word("address")
        word("value")
    elseif code == 22 then
        exactly(7)
        asked.address = word("address")
        word("and")
        word("or")
    else
        if not is_request then exactly(5) end
        asked.address = word("address")
        local written
        if code == 23 then
            local read = take(2)
            add(f.quantity, read)
            asked.quantity = read:uint()
            asked.write_address = word("write_address")
            if asked.quantity < 1 or asked.quantity > 125 then fail("quantity") end
            written = quantity(121)
        else
            asked.quantity = quantity(MAX_QUANTITY[code], not is_request and "quantity" or nil)
            written = asked.quantity
        end
        if is_request then
            local count = take(1):uint()
            if count ~= (code == 15 and math.floor((written + 7) / 8) or 2 * written) then fail("byte_count") end
            exactly(at + count)
            if code == 15 then rest_bits("values", written) else rest_words("values") end
        end
    end
    return asked
end

local function show_signal(tree, asked)
    if not asked.address then return end
    local wanted = TABLE_OF[asked.code]
    if not wanted then return end
    for _, row in ipairs(SIGNALS) do
        local of, name, first, last, n = row[1], row[2], row[3], row[4], row[5]
        if of == wanted and asked.address >= first and asked.address <= last then
            tree:add(f.signal, string.format("%s[%d]", name, asked.address - first + n)):set_generated()
            return
        end
    end
    tree:add_proto_expert_info(e.not_used)
end

local function join(range)
    local first, second = range(0, 2):uint(), range(2, 2):uint()
    if modbus.prefs.word_order == 1 then first, second = second, first end
    return first * 65536 + second, ByteArray.new(string.format("%04x%04x", first, second)):tvb("Real")
end

--- The registers of the telemetry block, `range` begins with the first.
local function show_telemetry(range, tree)
    local block = tree:add(modbus, range, "Telemetry")
    block:add(f.life_counter, range(0, 4), (join(range(0, 4))))
    block:add(f.override, range(4, 2))
    local norm = 0
    for index, name in ipairs(REALS) do
        local place = range(6 + 4 * (index - 1), 4)
        local _, bytes = join(place)
        local value = bytes(0, 4):float()
        local item = block:add(f[name], place, value)
        local is_tiny = value ~= 0 and math.abs(value) < 1.17549435e-38
        if value ~= value or math.abs(value) == math.huge or is_tiny then item:add_proto_expert_info(e.impossible) end
        if name:sub(1, 2) == "Q_" then norm = norm + value * value end
    end
    if math.abs(norm - 1) > 1e-3 then block:add_proto_expert_info(e.impossible) end
end

local function match(pinfo, tree, at, transaction, unit, asked, is_request)
    local key = pinfo.number .. ":" .. at
    if not pinfo.visited then
        local id, now = stream_field().value .. ":" .. (transaction or ""), tonumber(tostring(pinfo.abs_ts))
        if is_request then
            open_requests[id] = { number = pinfo.number, time = now, unit = unit, asked = asked }
        else
            local request = open_requests[id]
            matches[key] = request and { request = request, time = now - request.time } or {}
            open_requests[id] = nil
        end
    end
    if is_request then return end
    local request = (matches[key] or {}).request
    if not request then
        tree:add_proto_expert_info(e.unasked)
        return
    end
    tree:add(f.request_in, request.number):set_generated()
    tree:add(f.response_time, matches[key].time):set_generated()
    local wanted = request.asked
    local bytes = wanted.quantity and (wanted.code <= 2 and math.floor((wanted.quantity + 7) / 8) or 2 * wanted.quantity)
    local differs = request.unit ~= unit or wanted.code ~= asked.code or asked.bytes and asked.bytes ~= bytes
        or asked.address and asked.address ~= wanted.address
    if differs then tree:add_proto_expert_info(e.mismatch) end
    return request
end

--- A line for the list of packets: "Request: read holding registers 0 to 36".
local function summary(asked, is_request, request)
    local kind = is_request and "Request" or asked.exception and "Exception " .. asked.exception or "Reply"
    local what = FUNCTIONS[asked.code] or "function " .. asked.code
    local first = asked.address or request and request.asked.address
    local many = asked.quantity or request and request.asked.quantity or 1
    local range = not first and "" or many > 1 and string.format(" %d to %d", first, first + many - 1) or " " .. first
    return kind .. ": " .. what .. range
end

local function show_frame(tvb, pdu, transaction, unit, pinfo, tree, at, is_request)
    local frame = tree:add(modbus, tvb)
    local good, asked = pcall(read_pdu, pdu, is_request, function() end)
    if not good then
        if type(asked) ~= "table" then error(asked) end
        frame:add(f.decode_error, pdu(), asked.kind)
        frame:add_proto_expert_info(e.pdu)
        return "Error " .. asked.kind
    end
    if transaction then frame:add(f.transaction, tvb(0, 2)) end
    frame:add(f.unit, unit)
    read_pdu(pdu, is_request, function(field, range, value)
        if value then frame:add(field, range, value) else frame:add(field, range) end
    end)
    if asked.exception then frame:add_proto_expert_info(e.refused) end
    if is_request then
        show_signal(frame, asked)
        if asked.quantity and asked.address + asked.quantity > 65536 then frame:add_proto_expert_info(e.beyond) end
    end
    local request = match(pinfo, frame, at, transaction, unit:uint(), asked, is_request)
    local is_block = request and request.asked.code == 3 and request.asked.address == 0 and asked.bytes == 74
    if is_block then show_telemetry(pdu(2, 74), frame) end
    return summary(asked, is_request, request)
end

local function show_error(range, kind, tree)
    local item = tree:add(modbus, range)
    item:add(f.decode_error, range, kind)
    item:add_proto_expert_info(kind == "crc" and e.crc or e.header)
    return "Error " .. kind
end

--- What is wrong with the header at `at`, of which 6 bytes are there.
local function header_error(tvb, at)
    local length = tvb(at + 4, 2):uint()
    if tvb(at + 2, 2):uint() ~= 0 then return "protocol" end
    if length < 2 or length > 254 then return "mbap_length" end
end

--- Where the next frame may begin after the bad header at `at`.
local function next_header(tvb, at, is_request)
    local length = tvb(at + 4, 2):uint()
    local skip = length <= 254 and 6 + length or 1
    for place = at + skip, tvb:len() - 6 do
        if not header_error(tvb, place) then
            if place == at + skip and skip > 1 then return place end
            if rtu_length(tvb, place + 6, is_request) == tvb(place + 4, 2):uint() + 2 then return place end
        end
    end
    return tvb:len()
end

--- What the header at `at` of an exception counts, which is 3 if it is right (FM-89); nothing if there is none.
local function exception_length(tvb, at, is_request)
    if is_request or at < 0 or tvb:len() - at < 8 or header_error(tvb, at) then return end
    local code = tvb(at + 7, 1):uint()
    if code > EXCEPTION and NAMED[code - EXCEPTION] then return tvb(at + 4, 2):uint() end
end

--- The place and the length of the frame at `at`, whose error it has, or nothing if bytes are missing. `excess` bytes may belong to the
--- exception before it.
local function find_tcp(tvb, at, is_request, excess)
    local left = tvb:len() - at
    -- A header is hardly divided so soon.
    if left <= excess and left < 8 then return left, "noise" end
    for place = at, at + excess do
        if place > at and place == at + excess then return excess, "noise" end
        if tvb:len() - place < 8 then break end
        if not header_error(tvb, place) and tvb(place + 7, 1):uint() % EXCEPTION ~= 0 then
            if place > at then return place - at, "noise" end
            break
        end
    end
    if tvb:len() - at < 6 then return end
    local kind = header_error(tvb, at)
    if kind then return next_header(tvb, at, is_request) - at, kind end
    local length = tvb(at + 4, 2):uint()
    local counted = exception_length(tvb, at, is_request)
    local size = 6 + (counted and math.min(counted, 3) or length)
    if tvb:len() - at < size then return end
    if counted and counted > 3 then return size, "exception_length" end
    return size
end

local function has_crc(tvb, at, length)
    return crc16(tvb(at, length - 2)) == tvb(at + length - 2, 2):le_uint()
end

local function find_rtu(tvb, at, is_request)
    local left, length = tvb:len() - at, rtu_length(tvb, at, is_request)
    if length == nil then return end
    local kind
    if length == false then
        -- The end of a segment stands for the silence.
        if left >= 4 and left <= MAX_RTU and has_crc(tvb, at, left) then return left end
        if left <= MAX_RTU then return end
        kind = "too_long"
    elseif length > MAX_RTU then
        kind = "too_long"
    elseif left < length then
        return
    elseif has_crc(tvb, at, length) then
        return length
    end
    local first, first_end = tvb:len(), math.huge
    for place = at + 1, tvb:len() - 4 do
        local size = rtu_length(tvb, place, is_request)
        if size and place + size <= tvb:len() and place + size < first_end and has_crc(tvb, place, size) then
            first, first_end = place, place + size
        end
    end
    return first - at, kind or "crc"
end

function modbus.dissector(tvb, pinfo, tree)
    pinfo.cols.protocol = "FANUC Modbus"
    local is_request = pinfo.src_port ~= pinfo.match_uint
    local is_tcp, info, at, excess = modbus.prefs.framing == 1, {}, 0, 0
    while at < tvb:len() do
        local length, kind = (is_tcp and find_tcp or find_rtu)(tvb, at, is_request, excess)
        if not length then
            pinfo.desegment_offset = at
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            break
        end
        local range = tvb(at, length)
        if kind then
            table.insert(info, show_error(range, kind, tree))
        else
            local transaction = is_tcp and range(0, 2):uint() or nil
            local unit = range(is_tcp and 6 or 0, 1)
            local pdu = is_tcp and range(7) or range(1, length - 3)
            table.insert(info, show_frame(range, pdu:tvb(), transaction, unit, pinfo, tree, at, is_request))
        end
        local counted = is_tcp and kind ~= "noise" and exception_length(tvb, at, is_request)
        excess = counted and math.abs(counted - 3) or 0
        at = at + length
    end
    if #info > 0 then pinfo.cols.info = table.concat(info, ", ") end
end

DissectorTable.get("tcp.port"):add_for_decode_as(modbus)
